"""The contract of every effect: compiled as written, power as energy, nothing at zero strength."""

from __future__ import annotations

import ctypes
import dataclasses
import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import types

from alf_ros import InputError, Simulation, effects, kernel, load_scene
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation import setup as settings
from support.cut_blocks import on_cut_blocks
from support.effect_examples import (
    CASES,
    DRIVEN,
    EXAMPLES,
    LOADED,
    PLANAR,
    as_python,
    in_plane_or_space,
    simulation,
)
from support.thorough import thinned

_STORING = ('gravity', 'spring', 'torsion_spring', 'joint_stop', 'ground_contact', 'tendon')
CONSERVATIVE = {case for case in CASES if case[0] in _STORING and case not in DRIVEN}


def applied(sim: Simulation, q, qd):
    Q = np.zeros(q.size)
    near, all_effects = sim.sample()._near, sim._run.applied.assembled.effects
    kernel.applied_forces(all_effects, sim.t, q, qd, near, Q)
    kernel.add_friction(all_effects, sim.t, q, qd, near, sim.sample().friction_loads, Q)
    return Q


def test_every_effect_has_examples() -> None:
    assert set(EXAMPLES) == set(effects.kinds())


@pytest.mark.parametrize('kind, which', CASES)
def test_compiled_is_what_is_written(
    kind: str, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = simulation(kind, which)
    sim.step(130)
    sample, (q, qd) = sim.sample(), (sim.state.q, sim.state.qd)
    compiled = applied(sim, q, qd)
    energy = kernel.potential_energy(sim._run.applied.assembled.effects, sim.t, q, sample._near)
    module = effects.load(kind)
    packed = module.pack(list(sim.scene.effects), sim.model.layout)
    shared = [
        importlib.import_module(f'alf_ros.effects.contract.{name}')
        for name in ('scalars', 'gap_vectors', 'piecewise', 'affine_force')
    ]
    as_python(monkeypatch, module, *shared)
    near, data, python = sample._near, (packed.slots, packed.params), np.zeros(q.size)
    module.force.__wrapped__(sim.t, q, qd, near, *data, python)
    if (kind, which) in LOADED:
        assert sample.friction_loads[:2].min() > 0.5
        module.friction.__wrapped__(sim.t, q, qd, near, sample.friction_loads, *data, python)
    # products and sums may be fused, and powers taken by other libraries: the last bits may differ
    size = np.abs(compiled).max()
    assert size > 0.1
    assert compiled == pytest.approx(python, rel=1e-13, abs=1e-14 * size)
    if hasattr(module, 'potential'):
        written = module.potential.__wrapped__(sim.t, q, near, *data)
        assert energy == pytest.approx(written, rel=1e-13)


@pytest.mark.parametrize('kind, which', CASES)
def test_force_is_the_gradient_of_the_potential(kind: str, which: str) -> None:
    """At rest, along any motion of the coordinates: -∂V/∂q."""
    sim = simulation(kind, which)
    sim.step(130)
    q, near = sim.state.q, sim.sample()._near
    Q = applied(sim, q, np.zeros(q.size))
    directions = np.random.default_rng(1).normal(size=(5, q.size))
    forces = sim._run.applied.assembled.effects
    for d in directions:
        h = 1e-6
        ahead, behind = (kernel.potential_energy(forces, sim.t, q + s * d, near) for s in (h, -h))
        slope = (behind - ahead) / (2.0 * h)
        if (kind, which) in CONSERVATIVE:
            assert slope == pytest.approx(Q @ d, rel=1e-6, abs=1e-6)
        else:
            assert slope == 0.0


@pytest.mark.parametrize('kind, which', thinned(CASES, in_plane_or_space))
def test_power_is_the_rate_of_energy(kind: str, which: str) -> None:
    """dE/dt = Q·q̇ without what the potential counts; friction, dampers and drag only take."""
    sim = simulation(kind, which, step=1e-4)
    sim.step(1300)
    energies = []
    power = dissipation = 0.0
    for n in range(3):
        q, qd = sim.state.q, sim.state.qd
        if n == 1:
            rest = applied(sim, q, np.zeros(q.size)) if (kind, which) in CONSERVATIVE else 0.0
            dissipation = (applied(sim, q, qd) - rest) @ qd
            power = applied(sim, q, qd) @ qd
        energies.append(sim.sample().energy)
        sim.step()
    rate = (energies[2] - energies[0]) / 2e-4
    expected = dissipation if (kind, which) in CONSERVATIVE else power
    assert rate == pytest.approx(expected, rel=2e-4, abs=1e-6)
    if kind in ('damper', 'joint_friction', 'torsion_spring', 'joint_stop', 'ground_contact'):
        assert expected < -1e-3


ON_JOINTS = ('joint_effort', 'torsion_spring', 'joint_stop', 'joint_friction', 'motor')


@pytest.mark.parametrize('kind, which', [case for case in CASES if case[0] in ON_JOINTS])
def test_efforts_of_joints_are_what_effects_exert(kind: str, which: str) -> None:
    """With the velocities of the joints they make the whole power."""
    sim = simulation(kind, which)
    sim.step(130)
    sample = sim.sample()
    power = applied(sim, sim.state.q, sim.state.qd) @ sim.state.qd
    assert abs(power) > 0.05
    assert sample.joint_efforts @ sample.joint_velocities == pytest.approx(power, rel=1e-10)
    assert sum(sample.powers.values()) == pytest.approx(power, rel=1e-10)


class InPython:
    """A function of an effect that the compiled step calls back in Python."""

    def __init__(self, compiled: Any) -> None:
        numbers, integers = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int64)
        kinds = {types.float64: ctypes.c_double, types.void: None}
        signature = compiled._sig
        of = [
            kinds.get(arg) or (integers if arg.dtype == types.int64 else numbers)
            for arg in signature.args
        ]
        self._kept = ctypes.CFUNCTYPE(kinds[signature.return_type], *of)(compiled.__wrapped__)
        self.address = ctypes.cast(self._kept, ctypes.c_void_p).value


@pytest.mark.parametrize('kind, which', thinned(CASES, in_plane_or_space))
def test_a_run_in_python_is_the_compiled_run(
    kind: str, which: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same steps, all functions of the effect as the Python that is written."""
    compiled = simulation(kind, which)
    compiled.step(20)
    module = effects.load(kind)
    for name in ('force', 'potential', 'friction'):
        if hasattr(module, name):
            monkeypatch.setattr(module, name, InPython(getattr(module, name)))
    shared = [
        importlib.import_module(f'alf_ros.effects.contract.{name}')
        for name in ('scalars', 'gap_vectors', 'piecewise', 'affine_force')
    ]
    as_python(monkeypatch, module, *shared)
    python = simulation(kind, which)
    python.step(20)
    assert python.state.q == pytest.approx(compiled.state.q, rel=1e-12, abs=1e-12)
    assert python.state.qd == pytest.approx(compiled.state.qd, rel=1e-11, abs=1e-11)
    assert python.sample().energy == pytest.approx(compiled.sample().energy, rel=1e-11)
    assert python.sample().powers == pytest.approx(compiled.sample().powers, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('integrator', ['rk4', 'esdirk43'])
@pytest.mark.parametrize('kind', EXAMPLES)
def test_zero_strength_is_absence(kind: str, integrator: str) -> None:
    """Also where it has a direction in which it might yield."""
    absent = Simulation(scene_from_text(PLANAR), integrator=integrator)
    zero = simulation(kind, 'without', integrator=integrator)
    for sim in (absent, zero):
        sim.apply_effort('shoulder', 1.0)
        sim.step(200)
    assert absent.state.q.tobytes() == zero.state.q.tobytes()


def test_a_rotor_without_inertia_is_none() -> None:
    motor = 'motor: {joint: elbow, effort: 2.0%s}'
    sims = []
    for armature in ('', ', armature: 0', ', armature: 0.5'):
        sims.append(Simulation(scene_from_text(f'{PLANAR}effects: {{{motor % armature}}}\n')))
        sims[-1].step(200)
    absent, zero, heavy = sims
    assert absent.state.q.tobytes() == zero.state.q.tobytes()
    assert absent.sample().points['B'] != pytest.approx(heavy.sample().points['B'], abs=1e-3)
    setup = settings.Setup(zero.scene, zero, 2)
    with pytest.raises(InputError, match='effects.motor.armature: an armature from or to zero'):
        settings.changed(setup, {}, {'effects.motor.armature': 0.5}, 500.0)
    assert settings.changed(setup, {}, {'effects.motor.effort': 1.0}, 500.0).simulation.t == zero.t


def needed(layout, body, q, qdd):
    """Rates of momentum and of its moment about the origin: of point masses like the body."""
    D = layout.dimension
    if D == 2:
        moments, axes = np.array([body.inertia, 0.0]), np.eye(2)
    else:
        J = np.array(body.inertia)
        moments, axes = np.linalg.eigh(0.5 * np.trace(J) * np.eye(3) - J)
    total = np.zeros(D + (1 if D == 2 else 3))
    rest = body.mass
    places = []
    for moment, axis in zip(moments, axes.T, strict=True):
        arm = np.sqrt(max(moment, 0.0) / (0.2 * body.mass)) * axis
        places += [(0.1 * body.mass, np.array(body.com) + s * arm) for s in (1.0, -1.0)]
        rest -= 0.2 * body.mass
    for m, local in [*places, (rest, np.array(body.com))]:
        form = layout.place(body.name, tuple(local))
        r = form.constant + sum(C @ q[block] for block, C in form.parts.items())
        force = m * sum(C @ qdd[block] for block, C in form.parts.items())
        total += [*force, *np.atleast_1d(cross(r, force))]
    return total


def cross(r, f):
    return np.cross(r, f) if len(r) == 3 else r[0] * f[1] - r[1] * f[0]


@pytest.mark.parametrize('kind, which', CASES)
def test_reactions_balance_each_body(kind: str, which: str) -> None:
    """On each body alone the effect and the joints make up what it needs: Newton and Euler."""
    sim = simulation(kind, which, integrator='dop853', step=1e-3)
    sim.step(130)
    sample = sim.sample()
    layout, reactions = sim.model.layout, sample._reactions()
    cut, D = reactions.cut, layout.dimension
    q, qd = on_cut_blocks(reactions, sim.state.q), on_cut_blocks(reactions, sim.state.qd)
    Q = np.zeros(q.size)
    kernel.applied_forces(sample._applied.on(cut), sim.t, q, qd, sample._near, Q)
    kernel.add_friction(
        sample._applied.on(cut), sim.t, q, qd, sample._near, sample.friction_loads, Q
    )
    q, exerted = q.reshape(-1, D), Q.reshape(-1, D)
    qdd = on_cut_blocks(reactions, sample._accelerated[0].qdd).reshape(-1, D)
    largest = 0.0
    for body in layout.bodies:
        blocks = list(cut.of_body[body.name])
        force = exerted[blocks[: len(body.points)]].sum(axis=0)
        moment = sum(cross(q[block], exerted[block]) for block in blocks)
        total = np.array([*force, *np.atleast_1d(moment)])
        for n, joint in enumerate(layout.mechanism.joints):
            sign = (joint.child == body.name) - (joint.parent == body.name)
            form = cut.place(joint.child, joint.frames[1].origin)
            r = form.constant + sum(C @ q[block] for block, C in form.parts.items())
            f, torque = sample.reaction_forces[n], sample.reaction_torques[n]
            total += sign * np.array([*f, *np.atleast_1d(cross(r, f) + torque)])
        wanted = needed(cut, body, q, qdd)
        largest = max(largest, np.abs(wanted).max())
        assert total == pytest.approx(wanted, abs=1e-7 * max(1.0, np.abs(wanted).max()))
    assert largest > 0.5


@pytest.mark.parametrize(
    'text, message',
    [
        ('spring: {between: [B, W]}', 'give one of stiffness, table'),
        ('spring: {between: [B, nowhere], stiffness: 1}', 'nowhere'),
        ('spring: {between: [ground, B], stiffness: 1}', 'a place on the ground'),
        ('spring: {between: [B, W], at: [[0, 0], ~], stiffness: 1}', 'has no place of its own'),
        ('spring: {between: [B, W], stiffness: -1}', 'must not be negative'),
        ('spring: {between: [B, W], table: [[0, 0], [0, 1]]}', 'must ascend'),
        ('spring: {between: [B, W], table: [[0, 0]]}', 'two points'),
        ('spring: {between: [B, W], table: []}', 'an empty table'),
        ('damper: {between: [B, W], table: [[0, 0], [1]]}', 'rows of equal length'),
        ('torsion_spring: {joint: elbw, stiffness: 1}', "did you mean 'elbow'"),
        ('joint_stop: {joint: elbow, stiffness: 1}', 'lower or an upper'),
        ('joint_stop: {joint: elbow, stiffness: 1, lower: 1, upper: 0}', 'below the upper'),
        ('joint_friction: {joint: elbow, dynamic: 0.2, static: 0.1}', 'static must not be less'),
        ('joint_friction: {joint: rail, dynamic: 1, radius: 0.1}', 'no radius'),
        ('motor: {joint: elbow, position: 1}', 'go together'),
        ('motor: {joint: elbow, position: 1, velocity_gain: 1}', 'also where the gain is 0'),
        ('motor: {joint: elbow, position_gain: 1}', 'go together'),
        ('motor: {joint: elbow, velocity: 1}', 'needs velocity_gain'),
        ('ground_contact: {on: B, stiffness: 1, normal: [0, 0]}', 'no direction'),
        ('ground_contact: {on: B, stiffness: 1, exponent: 0.5}', 'must be 1 at least'),
        ('tendon: {stiffness: 1}', 'give one of joints, path'),
        ('tendon: {joints: [[elbw, 1]]}', "did you mean 'elbow'"),
        ('tendon: {joints: [[elbow, 0]]}', 'it has no length'),
        ('tendon: {joints: [[elbow, 1]], free_length: 1}', 'free_length needs stiffness'),
        ('tendon: {joints: [[elbow, 1], [elbow, 2]]}', 'has one factor'),
        ('tendon: {joints: [[elbow, 1]], lower: 1}', 'need stop_stiffness'),
        ('tendon: {joints: [[elbow, 1]], position: 1}', 'go together'),
        ('tendon: {path: [A]}', 'two places at least'),
        ('tendon: {path: [A, A]}', 'are the same'),
        ('tendon: {path: [A, B], weights: [1, 1]}', 'one less than the places'),
        ('tendon: {path: [A, ground]}', 'a place on the ground'),
        ('tendon: {path: [A, [B, [0, 0]]]}', 'has no place of its own'),
        ('drag: {on: B, spin: 1}', 'no orientation'),
        ('user_table: {on: B, table: []}', 'an empty table'),
        ('user_table: {on: B, table: [[0, 1]]}', '2 columns, expected 3'),
        ('user_table: {on: B, table: [[0, 1, 1, 1]]}', 'no orientation'),
        ('user_table: {table: [[0, 1, 1, 1]]}', 'give one of on, joint'),
        ('user_table: {on: B, table: [[0, 1, 1]], interpolation: square}', 'square'),
    ],
)
def test_what_cannot_be_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scene_from_text(f'{PLANAR}\neffects: {{{text}}}\n')


def test_a_number_that_cannot_be_has_its_line() -> None:
    text = f'{PLANAR}\neffects:\n  spring:\n    between: [B, W]\n    stiffness: -1\n'
    line = len(text.split('\n')) - 1
    expected = f"{line}: effects.spring.stiffness: stiffness must not be negative, got '-1'$"
    with pytest.raises(InputError, match=expected):
        scene_from_text(text)


ON_SLIDER_CRANK = [
    ('drag: {on: coupler}', 'drag: has no effect; expected one of linear, quadratic, spin'),
    (
        'drag: [{on: coupler, wind: [1, 0], spin: 1}]',
        r'drag\[0\].wind: .*linear or quadratic beside',
    ),
    (
        'constant_wrench: {on: coupler, frame: body}',
        'has no effect; expected one of force, torque',
    ),
    (
        'constant_wrench: {on: coupler, torque: 1, at: B}',
        "at: .*got 'B'; expected force beside it",
    ),
    (
        'joint_friction: {a: {joint: knee, load: 5}}',
        'a.load: has no meaning here, .*dynamic or static',
    ),
    ('joint_friction: {joint: knee, viscous: 1, load: 5}', 'load: .* dynamic or static beside it'),
    ('joint_friction: {joint: knee, viscous: 1, load: 5, dynamic: 0}', ''),
    ('joint_friction: {joint: knee}', 'joint_friction: has no effect; expected one of visc'),
    ('motor: {joint: knee, limit: 5}', ''),
    ('tendon: {joints: [[knee, 1]]}', ''),
    ('tendon: {joints: [[knee, 1]], damping: 0, stop_stiffness: 5}', 'stop_stiffness: .*lower or'),
    (
        'tendon: {joints: [[knee, 1]], damping: 0, weights: []}',
        'weights: .*expected path beside it',
    ),
    ('ground_contact: {on: B, stiffness: 5, slip: 1}', 'slip: .*expected friction beside it'),
    ('user_table: {joint: knee, table: [[0, 1]], frame: body}', "frame: .*'body'; expected on"),
    (
        'user_table: {joint: knee, table: [[0, 1]], at: [0, 1]}',
        'at: has no meaning here; expected',
    ),
    ('user_table: {table: [[0, 1]]}', 'give one of on, joint'),
    ('drag: {on: coupler, spin: 0, at: ~}', ''),
    ('drag: {on: coupler, linera: {x: 1}}', "linera: unknown key, .*did you mean 'linear'"),
    ('drag: {onn: coupler, linear: {x: 1}}', "onn: unknown key, .*did you mean 'on'"),
    ('drag: {on: coupler, linear: {x: 1}}', 'drag.linear: a mapping given'),
    ('drag: {a: {on: coupler, linear: 1}, b: 5}', 'drag.b: wrong kind of value'),
    ('drag: {on: {on: coupler, linear: 1}}', ''),
]


@pytest.mark.parametrize(('text', 'message'), ON_SLIDER_CRANK)
def test_keys_without_effect_are_refused(text: str, message: str, tmp_path: Path) -> None:
    """But for zeros that are given: a variation, or a fit, may change them."""
    file = tmp_path / 'scene.yaml'
    file.write_text(f'mechanism: slider_crank\neffects:\n  {text}\n', 'utf-8')
    if not message:
        assert len(load_scene(file).effects) == 1
        return
    with pytest.raises(InputError, match=rf'scene.yaml:3: effects\..*{message}'):
        load_scene(file)


@pytest.mark.parametrize('form', ['{}', '[{}]', '{{one: {}}}'])
@pytest.mark.parametrize('kind', [kind for kind in effects.own() if effects.load(kind).MULTIPLE])
def test_a_wrong_key_is_named(kind: str, form: str, tmp_path: Path) -> None:
    """With a mapping as its value too, which may be meant as an instance."""
    file = tmp_path / 'scene.yaml'
    for field in dataclasses.fields(effects.load(kind).Parameters):
        for value in ('1', '{a: 1}'):
            other = next(f.name for f in dataclasses.fields(effects.load(kind).Parameters))
            rest = '' if other == field.name else f'{other}: B, '
            one = f'{{{rest}{field.name}x: {value}}}'
            if form == '{}' and not rest and value != '1':
                continue  # an instance of that name
            text = f'mechanism: slider_crank\neffects: {{{kind}: {form.format(one)}}}\n'
            file.write_text(text, 'utf-8')
            with pytest.raises(InputError, match=f"{field.name}x: unknown key, .*'{field.name}'"):
                load_scene(file)
