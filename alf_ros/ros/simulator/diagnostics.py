"""/diagnostics: one status per task, with the same keys in the same order every time.

Values are numbers as text, SI, the unit in the key. Levels: OK, WARN (look), ERROR (stopped).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from alf_ros.errors import StepError
from alf_ros.model.softest_modes import near
from alf_ros.ros.namesake import KEY
from alf_ros.ros.recording.recorder import Recorder
from alf_ros.ros.simulator.inputs import CommandSubscriber
from alf_ros.ros.simulator.output_costs import NOTHING, Spent
from alf_ros.ros.simulator.pacing import Pacer
from alf_ros.ros.simulator.trajectory_tracking import Tracking
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.simulation import Simulation

CONSTRAINTS = (
    'position_violation_m',
    'velocity_violation_m_per_s',
    'rank',
    'redundant',
    'indeterminate_reactions',
    'indeterminate_efforts',
    'singular',
    'distance_to_singular',
)
_ENERGY = ('energy_j', 'initial_energy_j', 'change_j')
# Part of the ticks that may come late: on a busy desktop some always do.
MOST_LATE = 0.05
MOST_LOST = 0.01  # of the energies of a motion, that steps lose or gain
_SLOW = 1e-3  # 1/s, sizes of the mechanism a second
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@dataclass(frozen=True)
class Report:
    """The report of one task."""

    task: str
    level: bytes
    message: str
    values: Mapping[str, object]


def solver(simulation: Simulation, state: str, failure: StepError | None) -> Report:
    """Steps made, iterations and cost; after a failed step its reason and the remedy.

    WARN for steps that are too long, and for an accuracy that was asked for and cannot be met.
    """
    sample, settings, budget = simulation.sample(), simulation.solver, simulation.accuracy
    found = sample.diagnostics
    measured = not math.isnan(found.resolution.error)
    values = {
        'state': state,
        'simulated_time_s': sample.t,
        'step_index': sample.step,
        'iterations': found.iterations,
        'step_cost_s': found.step_cost,
        'integrator': settings.integrator,
        'tolerance': settings.tolerance,
        'step_error': found.resolution.error if measured else 'unknown',
        'adequate_step_s': found.adequate_step if measured else 'unknown',
        'accuracy_asked_m': settings.accuracy or 'no',
        'accuracy_estimate_m': budget.estimate if budget else 'unknown',
        'accuracy_horizon_s': budget.horizon if budget else 'unknown',
        'reason': failure.reason if failure else '',
        'remedy': failure.remedy if failure else '',
    }
    if not failure and found.trouble:
        return Report('solver', WARN, found.trouble, values)
    if not failure and budget and not budget.met:
        message = f'accuracy of {budget.asked:g} m not met: {budget.estimate:.2g} m at best'
        return Report('solver', WARN, message, values)
    return Report('solver', ERROR if failure else OK, str(failure) if failure else state, values)


def constraints(sample: Sample, closest: float = math.inf) -> Report:
    """Violations, and what the rows say of the position: rank and redundant rows.

    WARN at a singular position, for friction under a load that is not unique, and when a singular
    position was passed since the last report: `closest` is the least distance since then.
    """
    found = sample.diagnostics
    try:
        closest = min(closest, found.distance)
        values = (
            found.position_violation,
            found.velocity_violation,
            found.rank,
            found.redundant,
            _indeterminate(sample),
            _open_efforts(sample),
            found.singular,
            closest,
        )
    except StepError as error:
        unknown = dict.fromkeys(CONSTRAINTS, 'unknown')
        return Report('constraints', ERROR, str(error), unknown)
    told = dict(zip(CONSTRAINTS, values, strict=True))
    if found.singular:
        message = 'singular position: the reactions are not unique here'
        return Report('constraints', WARN, message, told)
    if sample.open_loads:
        names = ', '.join(sample.open_loads)
        message = f'{names}: the load is one of many that balance, and so is the motion'
        return Report('constraints', WARN, message, told)
    if closest < near(sample.model):
        return Report('constraints', WARN, 'passed near a singular position', told)
    return Report('constraints', OK, f'{found.redundant} redundant rows', told)


def _indeterminate(sample: Sample) -> str:
    """The joints whose reaction is one of many that balance; 'no' if there are none."""
    if not sample.diagnostics.redundant:
        return 'no'
    each = sample.reactions.items()
    return ', '.join(name for name, reaction in each if reaction.indeterminate) or 'no'


def _open_efforts(sample: Sample) -> str:
    """The drives whose effort is one of many that balance; 'no' if there are none."""
    each = sample.open_drive_efforts.items()
    return ', '.join(name for name, is_open in each if is_open.any()) or 'no'


def energy(sample: Sample, initial: float) -> Report:
    """Total mechanical energy and its change since the run began, by drives and friction too."""
    try:
        change = sample.energy - initial
    except StepError as error:
        return Report('energy', ERROR, str(error), dict.fromkeys(_ENERGY, 'unknown'))
    values = dict(zip(_ENERGY, (sample.energy, initial, change), strict=True))
    return Report('energy', OK, f'{sample.energy:.6g} J', values)


def balance(sample: Sample) -> float:
    """Kinetic energy less all works, J: it stays as it is. 0 without a ledger."""
    works = sample.state.works.values()
    return sample.kinetic_energy - sum(works) if works else 0.0


def work(sample: Sample, initial: float) -> Report:
    """Work of each effect, of inputs and drives since the start, and the difference to the change
    of kinetic energy: the error of the steps.

    WARN if that is large beside the energies of the motion, also within the tolerance of each
    step.
    """
    try:
        lost, works = balance(sample) - initial, sample.works
    except StepError as error:
        return Report('work', ERROR, str(error), {})
    values = {f'{name}_j': work for name, work in works.items()}
    told = f'{lost:.1e} J not accounted for'
    turned_over = max(sample.kinetic_energy, *map(abs, works.values()), _slow(sample))
    is_large = abs(lost) > MOST_LOST * turned_over
    if is_large:
        told += ': errors of the steps add up; take a smaller tolerance or step'
    level = WARN if is_large else OK
    return Report('work', level, told, {**values, 'missing_j': lost})


def _slow(sample: Sample) -> float:
    """Kinetic energy (J) of a motion so slow that its works are rounding of the forces."""
    mass = sum(body.mass for body in sample.model.mechanism.bodies)
    return float(0.5 * mass * (_SLOW * sample.model.size) ** 2)


@dataclass(frozen=True)
class Pace:
    """The counts of a pacer at some time: ticks, overruns, real time lost (s)."""

    ticks: int
    overruns: int
    lost: float


def timing(
    pacer: Pacer, paused: bool, before: Pace, spent: Spent, lagging: Sequence[str] = ()
) -> Report:
    """Real-time factor achieved, overruns, lateness; seconds of a tick in the solver and for
    topics; topics with reliable readers that are `lagging`.

    WARN when real time was lost since `before`, more than one tick in twenty came late, or readers
    lose messages of a run as fast as possible.
    """
    values = {
        'real_time_factor': pacer.achieved,
        'wanted_real_time_factor': pacer.factor,
        'tick_s': pacer.tick,
        'ticks': pacer.ticks,
        'overruns': pacer.overruns,
        'lost_real_time_s': pacer.lost,
        'lateness_p50_s': pacer.lateness[0],
        'lateness_p99_s': pacer.lateness[1],
        'steps_s_per_tick': spent.step,
        'topics_s_per_tick': spent.outputs,
        'slowest_topic': spent.slowest,
        'lagging_readers': ' '.join(lagging),
    }
    if lagging:
        return Report('timing', WARN, f'readers lose messages of {", ".join(lagging)}', values)
    lost = pacer.lost - before.lost
    if lost > 0.0:
        message = f'too slow: {lost:.3g} s of real time lost'
        advice = spent.advice(1.0 / pacer.tick)
        return Report('timing', WARN, f'{message}; {advice}' if advice else message, values)
    late, ticks = pacer.overruns - before.overruns, pacer.ticks - before.ticks
    if late > MOST_LATE * ticks:
        return Report('timing', WARN, f'{late} overruns in the last {ticks} ticks', values)
    message = 'paused' if paused else f'real-time factor {pacer.achieved:.3f}'
    return Report('timing', OK, message, values)


def commands(inputs: CommandSubscriber, process: str, twice: str) -> Report:
    """Commands accepted, refused by reason, timed out; the process of the node. WARN for some
    seconds after a trouble, and while a second node has this name, which `twice` says."""
    values = {
        'accepted': inputs.accepted,
        'held': inputs.held,
        'refused': sum(inputs.refused.values()),
        **{f'refused_{reason}': count for reason, count in inputs.refused.items()},
        'timed_out': inputs.timed_out,
        'timeout_s': inputs.timeout,
        'last_trouble': inputs.last_trouble,
        KEY: process,
    }
    if twice:
        return Report('commands', WARN, twice, values)
    if inputs.troubled:
        return Report('commands', WARN, inputs.last_trouble, values)
    return Report('commands', OK, f'{inputs.accepted} accepted', values)


def trajectory(tracking: Tracking) -> Report:
    """How well the joints follow their trajectories, rad or m. WARN when a tolerance was not kept,
    until the next trajectory."""
    goal = tracking.at_goal
    values = {
        'state': tracking.state,
        'joints': tracking.joints,
        'end_s': tracking.end,
        'path_error': tracking.worst.value,
        'path_error_joint': tracking.worst.joint,
        'path_error_time_s': tracking.worst.t,
        'path_tolerance': tracking.path,
        'goal_error': goal.value if goal else 'unknown',
        'goal_error_joint': goal.joint if goal else '',
        'goal_tolerance': tracking.goal,
        'goal_time_s': tracking.goal_time,
    }
    trouble = tracking.trouble
    return Report('trajectory', WARN if trouble else OK, trouble or tracking.state, values)


def record(
    recorder: Recorder | None, unrecorded: str = '', spent: Spent = NOTHING, rate: float = 0.0
) -> Report:
    """The log of a run with `rate` ticks per simulated second: messages written, dropped
    and waiting, and the load of the thread that writes.

    WARN after a drop, and where there is no log although one is wanted (`unrecorded` says why),
    ERROR when writing failed.
    """
    values = {
        'file': str(recorder.path) if recorder else '',
        'written_messages': recorder.written if recorder else 0,
        'dropped_messages': recorder.dropped if recorder else 0,
        'error': recorder.error if recorder else '',
        'waiting_bytes': recorder.waiting if recorder else 0,
        'bytes_per_tick': spent.logged / max(1, spent.ticks),
        'writer_load': spent.writer_load,
        'largest_topic': spent.largest if recorder else '',
        'lasting_rate_hz': spent.lasting_rate(rate),
    }
    if recorder is None:
        return Report('record', WARN if unrecorded else OK, unrecorded or 'off', values)
    if recorder.error:
        return Report('record', ERROR, recorder.error, values)
    if recorder.dropped:
        message, advice = f'{recorder.dropped} messages dropped', spent.advice(rate)
        return Report('record', WARN, f'{message}; {advice}' if advice else message, values)
    return Report('record', OK, recorder.path.name, values)


def array(node: str, hardware_id: str, stamp: Time, reports: list[Report]) -> DiagnosticArray:
    """The message: status names are `<node>: <task>`."""
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        DiagnosticStatus(
            level=report.level,
            name=f'{node}: {report.task}',
            message=report.message,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=str(value)) for key, value in report.values.items()],
        )
        for report in reports
    ]
    return message
