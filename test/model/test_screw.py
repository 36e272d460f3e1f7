"""A nut on a thread: its exact fall, its reactions over many turns, and what it is elsewhere."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import InputError, Simulation, load_scene
from alf_ros.exchange.urdf_export import closing, urdf
from alf_ros.scene.scene import INTEGRATORS, Scene, scene_from_text
from support.thorough import combined

M, J, ACROSS, G, PITCH = 0.8, 0.003, 0.02, 9.81, 0.25
NUT = """
mechanism:
  alf: 1
  space: spatial
  points: {{O: {{at: [0, 0, 0], fixed: true}}, A: {{at: [0, 0, 0.1]}}, B: {{at: [0.2, 0, 0.1]}}}}
  bodies:
    nut:
      points: [A, B]
      mass: {m}
      inertia: {{about_com: [{across}, {across}, {J}]}}
      com: [0, 0, 0]
  joints:
    thread: {{type: screw, between: [ground, nut], at: A, axis: [0, 0, 1], pitch: {pitch}}}
effects: {{gravity: {{acceleration: [0, 0, -9.81]}}{more}}}
"""


def nut(pitch: float = PITCH, more: str = '') -> Scene:
    return scene_from_text(NUT.format(m=M, J=J, across=ACROSS, pitch=pitch, more=more))


def advance(pitch: float) -> float:
    return pitch / (2.0 * math.pi)


@pytest.mark.parametrize('torque', [0.0, 1.5])
@pytest.mark.parametrize('pitch', [PITCH, -PITCH])
@pytest.mark.parametrize('integrator', INTEGRATORS)
def test_it_falls_along_the_helix(integrator: str, pitch: float, torque: float) -> None:
    """(J + m l²) θ̈ = τ - m g l, over turns; s = l θ; energy grows by the work of τ."""
    more = f', joint_effort: {{joint: thread, effort: {torque}}}' if torque else ''
    step, digits = (2.5e-4, 1e-6) if integrator == 'esdirk43' else (1e-3, 1e-7)  # 425 rad/s
    sim = Simulation(nut(pitch, more), integrator=integrator, step=step)
    lead = advance(pitch)
    alpha = (torque - M * G * lead) / (J + M * lead**2)
    first = sim.sample()
    for sample in sim.run(1.0, every=round(0.25 / step)):
        angle, rate = 0.5 * alpha * sample.t**2, alpha * sample.t
        far = max(1.0, abs(angle), abs(rate))
        thread = sample.joints['thread']
        assert thread.position == pytest.approx(angle, abs=digits * far)
        assert thread.velocity == pytest.approx(rate, abs=digits * far)
        assert thread.effort == pytest.approx(torque, abs=1e-12)
        assert sample.points['A'] == pytest.approx([0, 0, 0.1 + lead * angle], abs=digits * far)
        assert sample.velocities['A'][2] == pytest.approx(lead * thread.velocity, abs=1e-12 * far)
        work = torque * thread.position
        assert sample.energy - work == pytest.approx(first.energy, abs=1e-6 * far)
    assert abs(angle) > 6.0 * math.pi  # several turns


@pytest.mark.parametrize('integrator', ['rk4', 'dop853'])
def test_reaction(integrator: str) -> None:
    """Along the axis F = m (g + l θ̈); about it -l F, which turns the nut."""
    sim = Simulation(nut(), integrator=integrator, step=1e-3)
    lead = advance(PITCH)
    alpha = -M * G * lead / (J + M * lead**2)
    for sample in sim.run(1.0, every=100):
        reaction = sample.reactions['thread']
        assert not reaction.indeterminate
        force = M * (G + lead * alpha)
        assert reaction.force == pytest.approx([0, 0, force], abs=1e-6)
        along = np.asarray(reaction.torque)[2]
        assert along == pytest.approx(-lead * force, abs=1e-7)
        assert J * alpha == pytest.approx(along, abs=1e-7)


@pytest.mark.parametrize(
    ('step', 'integrator'), combined([8e-3, 3.1e-3], ['rk4', 'dop853', 'esdirk43'])
)
def test_its_nut_is_where_its_turns_are(integrator: str, step: float) -> None:
    """The sum s - l θ stays at its value, at any step: about 30 turns and 0.3 m."""
    sim = Simulation(load_scene('screw_jack'), integrator=integrator, step=step)
    sim.step(round(4.0 / step))
    assert slip(sim) < 1e-15
    assert abs(sim.sample().joints['thread'].position) > 150.0


def slip(sim: Simulation) -> float:
    """m, s - l θ of the jack's thread."""
    layout, q = sim.model.layout, sim.state.q.reshape(-1, 3)
    (joint,) = (each for each in sim.model.mechanism.joints if each.kind == 'screw')
    base, tip = joint.frames
    gap = layout.place(joint.child, tip.origin) - layout.place(joint.parent, base.origin)
    along = layout.direction(joint.parent, base.axes[2]).value(q) @ gap.value(q)
    return abs(float(along - joint.value * sim.sample().joints[joint.name].position))


def test_jack() -> None:
    """The motor's work lifts the lid or heats the bearing; ten turns push the rod 100 mm."""
    sim = Simulation(load_scene('screw_jack'), step=1e-3, ledger=True)
    first = sim.sample()
    for sample in sim.run(3.0, every=500):
        turned = sample.joints['bearing'].position
        assert sample.joints['thread'].position == pytest.approx(-turned, abs=1e-8)
        assert slip(sim) < 1e-15
        gained = sample.works['motor'] + sample.works['joint_friction']
        assert sample.energy - first.energy == pytest.approx(gained, abs=1e-7)
        length = np.linalg.norm(sample.points['C'] - sample.points['B'])
        drawn = np.linalg.norm(first.points['C'] - first.points['B'])
        assert length - drawn == pytest.approx(0.01 * turned / (2.0 * np.pi), abs=1e-8)
    assert turned > 30 * 2.0 * np.pi
    assert sample.points['P'][2] > first.points['P'][2] + 0.4


@pytest.mark.parametrize('turns', [0.2, -0.4])
def test_put_elsewhere_on_its_thread(turns: float) -> None:
    sim = Simulation(nut())
    away, angle = turns * PITCH, 2.0 * math.pi * turns
    half = 0.5 * angle
    sim.place('nut', [0, 0, 0.1 + away, 0, 0, math.sin(half), math.cos(half)])
    sample = sim.sample()
    assert sample.points['A'] == pytest.approx([0, 0, 0.1 + away], abs=1e-9)
    assert sample.joints['thread'].position == pytest.approx(angle, abs=1e-9)


def test_off_its_thread_it_cannot_be_put() -> None:
    """Nor by whole turns: a pose does not say how many."""
    sim = Simulation(nut())
    for away in (0.1, PITCH):
        with pytest.raises(InputError, match='nut cannot be there: thread is off by'):
            sim.place('nut', [0, 0, 0.1 + away, 0, 0, 0, 1])


def test_put_elsewhere_the_spindle_turns_as_often_as_it_must() -> None:
    """The lid is raised by hand; the thread stays in mesh over several turns."""
    sim = Simulation(load_scene('screw_jack'))
    before = sim.sample()
    drawn = before.body_poses[sim.model.body_names.index('lid')]
    raised = Rotation.from_rotvec([0, -math.radians(6), 0]) * Rotation.from_quat(drawn[3:])
    sim.place('lid', [*drawn[:3], *raised.as_quat()])
    after = sim.sample()
    lengths = [np.linalg.norm(each.points['C'] - each.points['B']) for each in (before, after)]
    turned = after.joints['bearing'].position - before.joints['bearing'].position
    assert turned > 4.0 * math.pi
    assert lengths[1] - lengths[0] == pytest.approx(0.01 * turned / (2.0 * math.pi), abs=1e-10)
    assert slip(sim) < 1e-13


def test_urdf_has_it_as_a_slide_that_mimics_a_turn() -> None:
    mechanism = nut().mechanism
    robot = ElementTree.fromstring(urdf(mechanism))
    joints = {each.get('name'): each for each in robot.iter('joint')}
    assert joints['thread'].get('type') == 'continuous'
    slide = joints['thread_length']
    assert slide.get('type') == 'prismatic'
    mimic = slide.find('mimic')
    assert mimic is not None and mimic.get('joint') == 'thread'
    assert float(mimic.get('multiplier', '')) == advance(PITCH)
    assert [joint.name for joint in closing(load_scene('screw_jack').mechanism)] == ['thread']


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match='pitch: a thread without pitch'):
        nut(0.0)
    with pytest.raises(InputError, match="missing key 'pitch'"):
        scene_from_text(NUT.format(m=1, J=1, across=1, pitch=1, more='').replace(', pitch: 1', ''))
    plane = NUT.replace('  space: spatial\n', '').replace('screw', 'screws')
    with pytest.raises(InputError):
        scene_from_text(plane.format(m=1, J=1, across=1, pitch=1, more=''))
