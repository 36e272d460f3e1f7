"""Find numbers of a scene that minimise a number of its motion, with a report.

See doc/optimisation.md.
"""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, writing
from alf_ros.commands.progress import ProgressBar
from alf_ros.studies.optimisation.optimisation_reading import read_study
from alf_ros.studies.optimisation.optimum import check_folder


def main(argv: Sequence[str] | None = None) -> int:
    """Optimise; returns 0, or 1 if the best search did not settle within its limits. Raises
    InputError, AlfError."""
    parser = Parser(
        command='optimise',
        description='Find numbers of a scene that minimise a number of its motion, with exact '
        'gradients. The result is a scene and a report.',
    )
    parser.add_argument(
        'study', metavar='STUDY.yaml', help='file of the study: what varies, and what is minimised'
    )
    parser.add_argument(
        '--starts', type=int, metavar='N', help='number of searches (default: as in the study)'
    )
    parser.add_argument(
        '--workers',
        type=int,
        metavar='N',
        help='processes of this machine that share the starts (default: one for each processor)',
    )
    parser.add_argument(
        '-o',
        '--output',
        default='optimised',
        metavar='DIR',
        help='folder of the new scene and the report (default: optimised)',
    )
    options = parser.parse_args(argv)
    with parser.naming():
        study = read_study(options.study, starts=options.starts, workers=options.workers)
    folder = paths.named(options.output, '--output')
    check_folder(folder, study.scene, '--output')
    with parser.naming(), ProgressBar('optimise') as bar:
        found = study.optimum(bar.note)
    print(found)
    with writing('--output', folder):
        found.save(folder)
    print(f'{folder}: {found.scene.name}.yaml, report.html')
    return 0 if found.settled and found.is_feasible else 1
