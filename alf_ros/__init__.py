"""ALF2 for mechanisms with closed loops: `load_scene`, `Simulation`, `record`, and their errors.

Nothing here needs ROS. Names are imported when first used, so that `import alf_ros` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from alf_ros.moved import announce

if TYPE_CHECKING:
    from alf_ros.errors import (
        AlfError,
        AssemblyError,
        BusyError,
        InputError,
        StepError,
        StoppedError,
    )
    from alf_ros.inspection.branches_report import Branches, branches
    from alf_ros.inspection.run import Run, record
    from alf_ros.scene.scene import Scene, load_scene
    from alf_ros.simulation.sample import Sample
    from alf_ros.simulation.simulation import Simulation
    from alf_ros.simulation.state import State
    from alf_ros.studies.atlas.assembly_search import Assemblies, assemblies
    from alf_ros.studies.atlas.position_map import Atlas, atlas
    from alf_ros.studies.closing.closure import Closure
    from alf_ros.studies.closing.posture import Posture
    from alf_ros.studies.ensemble.ensemble import ensemble
    from alf_ros.studies.ensemble.stepped_ensemble import Ensemble
    from alf_ros.studies.gradients.gradient import Gradient, gradient
    from alf_ros.studies.identification.identification import identify
    from alf_ros.studies.identification.identified import Identification
    from alf_ros.studies.identification.recording import Recording, recorded
    from alf_ros.studies.loads.fastest_run import FastestRun, fastest
    from alf_ros.studies.loads.load_history import LoadHistory
    from alf_ros.studies.loads.prescribed_loads import loads
    from alf_ros.studies.optimisation.optimisation import optimise
    from alf_ros.studies.optimisation.optimum import Optimum
    from alf_ros.studies.statics.equilibrium_path import EquilibriumPath, equilibrium_path
    from alf_ros.studies.statics.floquet import FloquetModel, floquet
    from alf_ros.studies.statics.linear_model import LinearModel
    from alf_ros.studies.statics.linearisation import linearise
    from alf_ros.studies.statics.positions_of_rest import Equilibrium, equilibria, equilibrium
    from alf_ros.studies.statics.vibration_modes import VibrationModes, modes

__all__ = [
    'AlfError',
    'Assemblies',
    'AssemblyError',
    'Atlas',
    'Branches',
    'BusyError',
    'Closure',
    'Ensemble',
    'Equilibrium',
    'FastestRun',
    'EquilibriumPath',
    'FloquetModel',
    'Gradient',
    'Identification',
    'InputError',
    'LinearModel',
    'LoadHistory',
    'Optimum',
    'Posture',
    'Recording',
    'Run',
    'Sample',
    'Scene',
    'Simulation',
    'State',
    'StepError',
    'StoppedError',
    'VibrationModes',
    'assemblies',
    'atlas',
    'branches',
    'ensemble',
    'equilibria',
    'equilibrium',
    'fastest',
    'equilibrium_path',
    'floquet',
    'gradient',
    'identify',
    'linearise',
    'load_scene',
    'loads',
    'modes',
    'optimise',
    'record',
    'recorded',
]

_HOME = {
    'AlfError': 'errors',
    'AssemblyError': 'errors',
    'BusyError': 'errors',
    'InputError': 'errors',
    'StepError': 'errors',
    'StoppedError': 'errors',
    'Branches': 'inspection.branches_report',
    'branches': 'inspection.branches_report',
    'Run': 'inspection.run',
    'record': 'inspection.run',
    'Sample': 'simulation.sample',
    'Scene': 'scene.scene',
    'load_scene': 'scene.scene',
    'Simulation': 'simulation.simulation',
    'State': 'simulation.state',
    'Assemblies': 'studies.atlas.assembly_search',
    'assemblies': 'studies.atlas.assembly_search',
    'Atlas': 'studies.atlas.position_map',
    'atlas': 'studies.atlas.position_map',
    'Closure': 'studies.closing.closure',
    'Posture': 'studies.closing.posture',
    'Equilibrium': 'studies.statics.positions_of_rest',
    'equilibria': 'studies.statics.positions_of_rest',
    'equilibrium': 'studies.statics.positions_of_rest',
    'EquilibriumPath': 'studies.statics.equilibrium_path',
    'equilibrium_path': 'studies.statics.equilibrium_path',
    'FloquetModel': 'studies.statics.floquet',
    'floquet': 'studies.statics.floquet',
    'LinearModel': 'studies.statics.linear_model',
    'linearise': 'studies.statics.linearisation',
    'FastestRun': 'studies.loads.fastest_run',
    'fastest': 'studies.loads.fastest_run',
    'LoadHistory': 'studies.loads.load_history',
    'loads': 'studies.loads.prescribed_loads',
    'VibrationModes': 'studies.statics.vibration_modes',
    'modes': 'studies.statics.vibration_modes',
    'Ensemble': 'studies.ensemble.stepped_ensemble',
    'ensemble': 'studies.ensemble.ensemble',
    'Gradient': 'studies.gradients.gradient',
    'gradient': 'studies.gradients.gradient',
    'Identification': 'studies.identification.identified',
    'identify': 'studies.identification.identification',
    'Optimum': 'studies.optimisation.optimum',
    'optimise': 'studies.optimisation.optimisation',
    'Recording': 'studies.identification.recording',
    'recorded': 'studies.identification.recording',
}

announce()


def __getattr__(name: str) -> object:
    import importlib

    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(importlib.import_module(f'{__name__}.{_HOME[name]}'), name)
