"""Enabled and disabled parts of a run, for the terminal: effects with their cost, outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from alf_ros.simulation.observables import joint_state_names
from alf_ros.simulation.simulation import Simulation

JOINTLESS = (
    'the mechanism has no joint coordinates: joint_states is not published and joint_commands is '
    'ignored; see ~/state, ~/markers and tf, and push with ~/wrench/<body>'
)
_MOST = 14  # names on a line
_SAME = 1e-6  # of a rate


def lines(
    simulation: Simulation,
    outputs: Mapping[str, Sequence[str]],
    sensors: Mapping[str, float],
    tick: float,
) -> list[str]:
    """Adjustments of the mechanism; meshes that viewers will not find; effects on, each with its
    µs per step here and now, and off; `sensors` with their µs per message, and those that ticks
    (s) are too long for; the ledger; outputs by `Outputs.switched`."""
    # Imported late: loading the solver takes a good part of the start.
    from alf_ros import effects
    from alf_ros.inspection.effect_costs import call_costs
    from alf_ros.inspection.missing_meshes import missing_meshes

    costs = [f'{label} {cost:.2g} µs' for label, cost in call_costs(simulation).items()]
    measured = [f'{label} {price:.2g} µs' for label, price in sensors.items()]
    fast = [
        f'{each.label} ({each.parameters.rate:g} Hz)'
        for each in simulation.scene.sensors
        if (each.parameters.rate or 0.0) * tick > 1.0 + _SAME
    ]
    named = {effect.kind for effect in simulation.scene.effects}
    absent = [kind for kind in effects.kinds() if kind not in named]
    on, subscribed, off = (_listed(outputs[mode]) for mode in ('on', 'subscribed', 'off'))
    adjusted = [f'mechanism: {simulation.adjustment}'] if simulation.adjustment else []
    unexamined = simulation.resolution.unexamined
    missed = simulation.missed  # asked for now: later it would delay a step
    about = [f'lengths miss a singular position by about {missed:.1g} m'] if missed else []
    missing = missing_meshes(simulation.scene.mechanism)
    jointless = [] if joint_state_names(simulation.model) else [JOINTLESS]
    return [
        *adjusted,
        *about,
        *([f'start: {unexamined}'] if unexamined else []),
        *jointless,
        *([f'meshes not drawn: {_listed(missing)}'] if missing else []),
        f'effects on, per step: {_listed(costs)}; ledger {"on" if simulation.ledger else "off"}',
        f'effects off: {_listed(absent)}',
        *([f'sensors, per message: {_listed(measured)}'] if sensors else []),
        *(
            [f'sensors with a rate above the {1.0 / tick:g} Hz of ticks: {_listed(fast)}']
            if fast
            else []
        ),
        f'outputs on: {on}; when subscribed: {subscribed}; off: {off}',
    ]


def _listed(names: Sequence[str]) -> str:
    more = f' and {len(names) - _MOST} more' if len(names) > _MOST else ''
    return ', '.join(names[:_MOST]) + more if names else 'none'
