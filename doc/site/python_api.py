"""The page of the Python interface: every public name, by autodoc from the sources."""

from __future__ import annotations

import alf_ros
from alf_ros import logs

# What the names of `alf_ros` return or take, and what the pages name
_WITH: dict[str, tuple[str, ...]] = {
    'Settings and inputs': (
        'alf_ros.scene.scene.Solver',
        'alf_ros.simulation.accuracy.Budget',
        'alf_ros.effects.contract.Effect',
        'alf_ros.effects.contract.trajectory.Curve',
        'alf_ros.scene.diff_drive_section.DiffDrive',
    ),
    'Sensors': (
        'alf_ros.scene.sensors_section.Sensor',
        'alf_ros.simulation.sensors.Sensors',
    ),
    'Models fitted to recordings': (
        'alf_ros.studies.identification.recording.MeasuredChannel',
        'alf_ros.studies.identification.recording.HeldInput',
        'alf_ros.studies.identification.recorded_names.Topics',
        'alf_ros.studies.identification.window.Window',
        'alf_ros.studies.identification.window.Measurements',
        'alf_ros.studies.identification.identified.ChannelFit',
        'alf_ros.studies.identification.residual_tests.Whiteness',
        'alf_ros.studies.identification.identifiability.Knowledge',
        'alf_ros.studies.identification.identifiability.Combination',
        'alf_ros.studies.identification.experiment_design.ExperimentDesign',
        'alf_ros.studies.identification.experiment_design.FurtherMotion',
    ),
    'Optimised designs': (
        'alf_ros.studies.optimisation.optimum.StartedSearch',
        'alf_ros.studies.optimisation.design_goal.DesignGoal',
        'alf_ros.studies.optimisation.design_goal.DesignLimit',
        'alf_ros.studies.optimisation.design_numbers.DesignNumbers',
        'alf_ros.studies.optimisation.designs.DesignCurve',
    ),
    'Loads and paths of equilibria': (
        'alf_ros.studies.loads.load_history.Peak',
        'alf_ros.studies.statics.equilibrium_path.PathEvent',
    ),
    'Maps of positions': (
        'alf_ros.inspection.branches_report.NamedBranch',
        'alf_ros.studies.atlas.assembly_search.FoundAssembly',
        'alf_ros.studies.atlas.map_coordinate.MapCoordinate',
        'alf_ros.studies.atlas.mapped_piece.MappedPiece',
        'alf_ros.studies.atlas.mapped_piece.Turning',
        'alf_ros.studies.atlas.curve_search.Node',
        'alf_ros.studies.atlas.map_search.Sheet',
        'alf_ros.studies.atlas.transmission.Bar',
    ),
    'What a sample holds': (
        'alf_ros.simulation.sample.JointState',
        'alf_ros.simulation.sample.Reaction',
        'alf_ros.simulation.sample_tangents.MotionTangent',
        'alf_ros.simulation.sample_tangents.JointTangent',
        'alf_ros.simulation.sample_diagnostics.Diagnostics',
        'alf_ros.simulation.resolution.Resolution',
    ),
    'Singular positions': (
        'alf_ros.simulation.singular_passes.Pass',
        'alf_ros.model.singular_branches.Branch',
        'alf_ros.model.singular_branches.Position',
    ),
}
_SURVEY = 'alf_ros.logs.log.Survey'
_TABLES = ('frame', 'to_csv', 'to_parquet')
_HEAD = """# Python API

Everything here needs no ROS. The names of the first section are imported from `alf_ros`; the
others are what these take and return. Units are SI, and vectors are in the world frame, unless a
name says otherwise. `Floats` is a numpy array of float64, `Integers` one of int64; shapes stand
before the unit: (N, D) m.
"""


def page() -> str:
    """The page in Markdown."""
    classes = [name for name in alf_ros.__all__ if not name.endswith('Error')]
    errors = [name for name in alf_ros.__all__ if name.endswith('Error')]
    sections = {
        'alf_ros': [f'alf_ros.{name}' for name in sorted(classes, key=_order)],
        'Errors': [f'alf_ros.{name}' for name in errors],
        **_WITH,
        'alf_ros.logs': [*(f'alf_ros.logs.{name}' for name in logs.__all__), _SURVEY],
        'alf_ros.logs.tables': [f'alf_ros.logs.tables.{name}' for name in _TABLES],
    }
    parts = [_HEAD]
    for title, names in sections.items():
        parts.append(f'## {title}\n\n```{{eval-rst}}\n{"".join(map(_entry, names))}```\n')
    return '\n'.join(parts)


def _order(name: str) -> int:
    """In the order in which a program uses them."""
    used = ['load_scene', 'Scene', 'Simulation', 'Sample', 'State', 'record', 'Run']
    return used.index(name) if name in used else len(used)


def _entry(name: str) -> str:
    module, _, own = name.rpartition('.')
    found = getattr(__import__(module, fromlist=[own]), own)
    if not isinstance(found, type):
        return f'.. autofunction:: {name}\n\n'
    options = ['members', *(['inherited-members'] if name == 'alf_ros.Sample' else [])]
    if issubclass(found, Exception):
        options = ['show-inheritance']
    lines = [f'.. autoclass:: {name}', *(f'   :{option}:' for option in options)]
    return '\n'.join([*lines, '', ''])
