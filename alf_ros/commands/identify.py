"""Fit numbers of a scene to recordings of its machine, with a report.

See doc/identification.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, pairs, refuse_given, writing
from alf_ros.commands.progress import ProgressBar
from alf_ros.errors import InputError
from alf_ros.scene.scene import load_scene
from alf_ros.scene.text.expression import ExpressionError, evaluate
from alf_ros.studies.identification import robust_loss
from alf_ros.studies.identification.candidate_motion import candidates
from alf_ros.studies.identification.design_runs import checked_duration
from alf_ros.studies.identification.first_starts import ANYWHERE, BEGINS
from alf_ros.studies.identification.identification import identify
from alf_ros.studies.identification.identified import check_folder
from alf_ros.studies.identification.recorded_names import Topics

_NAMED = {'priors': '--prior', 'design duration': '--design-duration'}


def main(argv: Sequence[str] | None = None) -> int:
    """Fit; returns 0, or 1 if the fit does not settle. Raises InputError, AlfError."""
    parser = Parser(
        command='identify',
        description='Fit numbers of a scene to recordings of its machine, and say how well the '
        'recordings determine them.',
    )
    parser.add_argument('scene', metavar='SCENE', help='name of a scene, or a file')
    parser.add_argument(
        'recordings',
        metavar='BAG',
        nargs='+',
        help='folders of rosbag2 (MCAP), .mcap files, or logs of the simulator',
    )
    parser.add_argument(
        '--fit',
        metavar='NAME',
        nargs='+',
        required=True,
        help='numbers to fit: coupler.mass spring.stiffness',
    )
    parser.add_argument(
        '--window', type=float, default=2.0, metavar='S', help='length of a window, s (default: 2)'
    )
    parser.add_argument(
        '--hold-out',
        type=float,
        default=0.0,
        metavar='PART',
        help='part of the windows that is kept away from the fit (default: 0)',
    )
    _pairs(parser, '--bounds', 'NAME=LEAST:LARGEST', 'least and largest values')
    _pairs(
        parser,
        '--prior',
        'NAME=MEAN:DEVIATION',
        'means and deviations that are known before the fit',
    )
    _pairs(parser, '--noise', 'CHANNEL=DEVIATION', 'known noise of channels (knee, knee.velocity)')
    parser.add_argument(
        '--loss',
        default='linear',
        choices=robust_loss.NAMES,
        help='loss function of the residuals (default: linear)',
    )
    parser.add_argument(
        '--delay',
        action='store_true',
        help='also fit the delay of the measurements behind the inputs',
    )
    parser.add_argument(
        '--begins',
        default=ANYWHERE,
        choices=BEGINS,
        help='how recordings begin, if that is known: at rest, or as the scene does at t = 0 '
        '(default: anywhere)',
    )
    _pairs(parser, '--map', 'RECORDED=NAME', 'names in the scene of recorded joints or topics')
    parser.add_argument(
        '--joints',
        default='joint_states',
        metavar='TOPIC',
        help='topic of measured joint states (default: joint_states)',
    )
    parser.add_argument(
        '--commands',
        default='joint_commands',
        metavar='TOPIC',
        help='topic of joint states whose efforts act (default: joint_commands)',
    )
    parser.add_argument(
        '--design',
        metavar='CANDIDATE',
        nargs='+',
        default=[],
        help='compare further motions: which would tell most? A scene, a recording whose inputs '
        'act, NAME=VALUE in the fitted scene, or SCENE,NAME=VALUE',
    )
    parser.add_argument(
        '--design-duration',
        type=float,
        metavar='S',
        help='length of the further motions, s (default: of the recording)',
    )
    parser.add_argument(
        '-o',
        '--output',
        default='identified',
        metavar='DIR',
        help='folder of the new scene, report and log (default: identified)',
    )
    options = parser.parse_args(argv)
    topics = Topics(options.joints, options.commands, pairs(options.map, '--map'))
    scene = load_scene(options.scene)
    if not options.design:
        refuse_given(options, ('design_duration',), 'has no meaning without --design')
    else:  # faults of candidates are told before the fit
        with parser.naming(**_NAMED):
            checked_duration(options.design_duration)
            candidates(options.design, scene, options.fit, topics)
    folder = paths.named(options.output, '--output')
    check_folder(folder, scene, bool(options.design), '--output')
    with parser.naming(**_NAMED), ProgressBar('identify') as bar:
        found = identify(
            scene,
            options.recordings,
            options.fit,
            window=options.window,
            hold_out=options.hold_out,
            bounds=_two(options.bounds, '--bounds'),
            priors=_two(options.prior, '--prior'),
            noise={n: _number(x, '--noise') for n, x in pairs(options.noise, '--noise').items()},
            loss=options.loss,
            delay=options.delay,
            begins=options.begins,
            topics=topics,
            report=bar.note,
        )
        design = None
        if options.design:
            design = found.design(
                options.design, duration=options.design_duration, topics=topics, report=bar.note
            )
    print(found)
    if design is not None:
        print(f'\n{design}\n')
    with writing('--output', folder):
        found.save(folder, design)
    files = f'{found.scene.name}.yaml, report.html' + (', design.json' if design else '')
    print(f'{folder}: {files}{_log(found, folder)}')
    return 0 if found.settled else 1


def _log(found: object, folder: object) -> str:
    """Write the log of the fitted run, if ROS is installed; returns the end of the last line."""
    try:
        from alf_ros.ros.recording.fitted_log import log_fitted
    except ImportError as error:
        return f' (no log of the fitted run: {error})'
    try:
        log, reason = log_fitted(found, folder)  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(str(error), key='--output') from None
    return f', {log.name}' + (f' (the run ends early: {reason})' if reason else '')


def _pairs(parser: Parser, option: str, metavar: str, what: str) -> None:
    parser.add_argument(option, metavar=metavar, nargs='+', default=[], help=what)


def _two(texts: Iterable[str], option: str) -> dict[str, tuple[float, float]]:
    found = {}
    for name, value in pairs(texts, option).items():
        first, given, second = value.partition(':')
        if not given:
            raise InputError('not two numbers', key=option, value=value, expected='A:B')
        found[name] = _number(first, option), _number(second, option)
    return found


def _number(text: str, option: str) -> float:
    if text.strip() in ('inf', '-inf'):
        return float(text)
    try:
        return evaluate(text, {})
    except ExpressionError as error:
        raise InputError(f'not a number: {error}', key=option, value=text) from None
