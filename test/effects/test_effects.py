"""Effects: the kernel runs the effects of the scene file, and no other effect exists in a run."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alf_ros import InputError, Simulation, effects, load_scene
from alf_ros.effects import Effect, contract, load
from alf_ros.effects.contract import affine_force
from alf_ros.scene.scene import scene_from_text
from support.effect_examples import as_python
from support.effect_scenes import PENDULUM

FRAMES = """
effects:
  constant_wrench:
    push: {on: rod, force: [1.0, 2.0], at: A}
    twist: {on: rod, torque: 0.5}
    follow: {on: rod, force: [0.0, -3.0], frame: body}
    pull: {on: A, force: [-0.5, 0.25]}
"""


def test_compiled_force_is_the_python_force(monkeypatch: pytest.MonkeyPatch) -> None:
    """The C function called by its address gives what the file gives as Python."""
    scene = scene_from_text(PENDULUM + FRAMES)
    sim = Simulation(scene)
    sim.step(321)
    from alf_ros import kernel

    model, q, qd = sim.model, sim.state.q, sim.state.qd
    forces, compiled = sim._run.applied.assembled.effects, np.zeros(q.size)
    near = np.zeros(sim.state.turns.size)
    kernel.applied_forces(forces, 0.0, q, qd, near, compiled)
    module, python = load('constant_wrench'), np.zeros(q.size)
    as_python(monkeypatch, affine_force)
    packed = module.pack(list(scene.effects), model.layout)
    module.force.__wrapped__(0.0, q, qd, near, packed.slots, packed.params, python)
    # the compiler may fuse a product and a sum: the last bit may differ
    assert compiled == pytest.approx(python, rel=4e-16, abs=1e-15)
    assert np.abs(compiled).max() > 1.0


def test_power_of_a_wrench_is_the_rate_of_energy() -> None:
    sim = Simulation(scene_from_text(PENDULUM + FRAMES), step=1e-4)
    energies = [sample.energy for sample in sim.run(0.4, at=[0.1999, 0.2, 0.2001])]
    sim = Simulation(scene_from_text(PENDULUM + FRAMES), step=1e-4)
    sim.step(2000)
    sample = sim.sample()
    spin = sample.joints['pin'].velocity
    a = sample.points['A']
    follow = np.array([3.0 * a[1], -3.0 * a[0]])  # (0, -3) turned with the rod, of length 1
    at_a = np.array([1.0, 2.0]) + [-0.5, 0.25] + 0.5 * follow
    power = at_a @ sample.velocities['A'] + 0.5 * spin
    assert (energies[2] - energies[0]) / 2e-4 == pytest.approx(power, rel=1e-6)


def test_gravity_is_the_weight_of_each_body_and_its_energy() -> None:
    sim = Simulation(load_scene('four_bar'), step=1e-4)
    samples = list(sim.run(1.0, every=100))
    energies = [sample.energy for sample in samples]
    assert np.ptp(energies) < 1e-9 * max(np.abs(energies))


def test_zero_strength_is_absence() -> None:
    absent = Simulation(scene_from_text(PENDULUM))
    zero = Simulation(
        scene_from_text(
            PENDULUM
            + 'effects:\n  gravity: {acceleration: [0, 0]}\n'
            + '  constant_wrench: {on: rod, force: [0, 0]}\n'
        )
    )
    for sim in (absent, zero):
        sim.apply_effort('pin', 1.0)
        sim.step(500)
    assert absent.state.q.tobytes() == zero.state.q.tobytes()


def test_effects_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match='orientation'):
        Simulation(scene_from_text(PENDULUM + 'effects: {constant_wrench: {on: A, torque: 1}}'))
    with pytest.raises(InputError, match='no point of'):
        Simulation(
            scene_from_text(
                PENDULUM.replace(
                    'A: {at: [L, 0]}', 'A: {at: [L, 0]}\n    X: {at: [1, 1], fixed: true}'
                )
                + 'effects: {constant_wrench: {on: rod, force: [0, 1], at: X}}'
            )
        )


def test_what_is_not_named_is_not_imported() -> None:
    code = (
        'import sys\n'
        'from alf_ros import Simulation; from alf_ros.scene import scene\n'
        f'for more in ("", "effects: {{torsion_spring: {{joint: pin, stiffness: 1}}}}"):\n'
        f'    sim = Simulation(scene.scene_from_text({PENDULUM!r} + more))\n'
        '    sim.step(3); sim.sample().energy; sim.sample().joint_efforts\n'
        '    parts = (name.split(".") for name in sys.modules)\n'
        '    named = {part[2] for part in parts if part[1:2] == ["effects"] and part[2:]}\n'
        '    print(sorted(named - {"contract"}))\n'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ['[]', "['torsion_spring']"]


def test_another_set_of_effects_compiles_no_kernel() -> None:
    from alf_ros import kernel

    Simulation(load_scene('slider_crank')).step()
    before = len(kernel.advance.signatures)
    Simulation(scene_from_text(PENDULUM + FRAMES)).step()
    Simulation(scene_from_text(PENDULUM)).step()
    assert len(kernel.advance.signatures) == before


def test_contract_is_what_every_effect_offers() -> None:
    from alf_ros import effects

    for kind in effects.kinds():
        module = load(kind)
        assert module.force._sig == contract.FORCE
        assert isinstance(module.MULTIPLE, bool) and module.__doc__
        for field in module.Parameters.__dataclass_fields__.values():
            assert {'kind', 'doc'} <= set(field.metadata)
    assert Effect('gravity', 'gravity', None).kind == 'gravity'


def test_the_core_knows_no_effect_by_name() -> None:
    package = Path(effects.__file__).parents[1]
    for room in ('kernel', 'mechanism', 'model', 'scene', 'simulation', 'ros'):
        for path in (package / room).rglob('*.py'):
            words = {
                node.value
                for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
                if isinstance(node, ast.Constant) and isinstance(node.value, str)
            }
            assert not words & set(effects.own()), path


def test_each_role_is_played_by_the_effect_that_says_so() -> None:
    played = {role: kind for kind in effects.own() for role in holds(kind)}
    assert played == effects.ROLES


def holds(kind: str) -> tuple[str, ...]:
    return getattr(effects.load(kind), 'HOLDS', ())
