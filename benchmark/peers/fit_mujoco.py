"""MuJoCo's system identification on recordings of a slider-crank with friction.

    python fit_mujoco.py recordings.json results.jsonl

Runs in the environment of the engines, see identification_peers.py. The loop is closed by a stiff
`connect`; the start is the true one. RK4, and sensors at the instants of the recording.
"""

from __future__ import annotations

import json
import math
import sys
import time
from typing import Any

import mujoco
import numpy as np
from mujoco import sysid

STIFF = 0.7  # timeconst of the `connect`, steps: the stiffest that is stable, as in peer_mujoco.py
SLIDER = 1e-4  # kg: a body needs some; with less the loop opens further


def model(step: float) -> Any:
    """MjSpec of crank and coupler, whose end is tied to a slider."""
    rod = f'<inertial pos="0.5 0 0" mass="1" diaginertia="1e-6 {1.0 / 12.0} {1.0 / 12.0}"/>'
    return mujoco.MjSpec.from_string(
        f'<mujoco><option gravity="0 -9.81 0" integrator="RK4" timestep="{step}" solver="Newton" '
        'tolerance="1e-15" iterations="100"><flag contact="disable" refsafe="disable"/></option>'
        f'<worldbody><body name="crank"><joint name="pin" axis="0 0 1" damping="0.3"/>{rod}'
        f'<body name="coupler" pos="1 0 0"><joint name="knee" axis="0 0 1"/>{rod}'
        '<site name="end" pos="1 0 0"/></body></body>'
        '<body name="slider"><joint name="rail" type="slide" axis="1 0 0" damping="0.2"/>'
        f'<inertial pos="0 0 0" mass="{SLIDER}" diaginertia="1e-9 1e-9 1e-9"/>'
        '<site name="B"/></body></worldbody>'
        f'<equality><connect site1="end" site2="B" solref="{STIFF * step} 1" '
        'solimp="0.9999 0.9999 0.001 0.5 2"/></equality>'
        '<sensor><jointpos name="pin_position" joint="pin"/>'
        '<jointpos name="rail_position" joint="rail"/></sensor></mujoco>'
    )


def set_mass(spec: Any, parameter: Any) -> None:
    """The mass of the coupler, a rod: its inertia grows with it."""
    mass = float(parameter.value[0])
    body = spec.body('coupler')
    body.mass = mass
    body.inertia = [1e-6, mass / 12.0, mass / 12.0]


def set_damping(spec: Any, parameter: Any) -> None:
    """The friction of the crank."""
    spec.joint('pin').damping = [float(parameter.value[0]), 0.0, 0.0]


def start(spec: Any, case: dict[str, Any]) -> Any:
    """The state at the first instant."""
    theta, rate = case['theta'], case['rate']
    q = np.array([theta, -2.0 * theta, 2.0 * math.cos(theta)])
    v = np.array([rate, -2.0 * rate, -2.0 * math.sin(theta) * rate])
    return sysid.create_initial_state(spec.compile(), q, v, np.zeros(0))


def fitted(case: dict[str, Any], recording: dict[str, Any]) -> dict[str, Any]:
    """Estimates of a recording and their cost."""
    spec = model(case['step'])
    # sensors are evaluated where a step begins, and stamped with its end: so are the readings here
    t = np.array(recording['t']) + case['step']
    measured = np.array(recording['readings'])  # (n, 2)
    parameters = sysid.ParameterDict()
    for name, modifier in (('coupler.mass', set_mass), ('pin.viscous', set_damping)):
        low, high = case['bounds'][name]
        parameters.add(
            sysid.Parameter(
                name, nominal=case['begin'][name], min_value=low, max_value=high, modifier=modifier
            )
        )
    compiled = spec.compile()
    sequences = sysid.ModelSequences(
        'machine',
        spec,
        'recording',
        start(spec, case),
        sysid.TimeSeries(t, np.zeros((len(t), 0))),
        sysid.TimeSeries.from_names(t, measured, compiled),
    )
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    begun = time.process_time()
    found, _ = sysid.optimize(
        initial_params=parameters, residual_fn=residual, optimizer='mujoco', verbose=False
    )
    spent = time.process_time() - begun
    return {'cpu': spent, **{name: float(found[name].value[0]) for name in case['begin']}}


if __name__ == '__main__':
    with open(sys.argv[1], encoding='utf-8') as stream:
        case = json.load(stream)
    with open(sys.argv[2], 'a', encoding='utf-8') as out:
        for recording in case['recordings']:
            said = {'about': f'mujoco {mujoco.__version__}', **fitted(case, recording)}
            print(json.dumps(said), file=out, flush=True)
