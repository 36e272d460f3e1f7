"""Measurements of sensors against exact motions, differences of poses, and statistics."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Scene, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.scene.scene import scene_from_text
from alf_ros.simulation.display_geometry import poses
from alf_ros.simulation.sample import Sample
from alf_ros.simulation.sensors import Sensors

G = 9.81
ARM = 0.7  # m
PENDULUM = {
    'alf': 1,
    'points': {'O': {'at': [0, 0], 'fixed': True}, 'P': {'at': [ARM, 0]}},
    'bodies': {'rod': {'points': ['O', 'P'], 'mass': 2.0, 'inertia': 'rod'}},
    'joints': {'pin': {'type': 'revolute', 'between': ['ground', 'rod'], 'at': 'O'}},
}


def pendulum(**sensors: object) -> Scene:
    return load_scene(
        {
            'mechanism': PENDULUM,
            'effects': {'gravity': {'acceleration': [0, -G]}},
            'sensors': sensors,
            'initial': {'velocities': {'P': [0, 2.0]}},
        }
    )


def measured(scene: Scene, simulation: Simulation) -> dict[str, Floats]:
    (found,) = Sensors(scene).read(simulation.sample()).values()
    return dict(found)


def test_specific_force_and_reaction_of_a_pendulum() -> None:
    """θ̈ = -3 g cos θ / 2 l about the end of a rod; energy gives θ̇."""
    scene = pendulum(imu={'body': 'rod', 'at': 'P'})
    simulation = Simulation(scene, tolerance=1e-12)
    simulation.step(500)
    theta = simulation.sample().joints['pin'].position
    rate2 = (2.0 / ARM) ** 2 - 3.0 * G / ARM * math.sin(theta)
    turn = -1.5 * G * math.cos(theta) / ARM
    found = measured(scene, simulation)
    felt = [-rate2 * ARM + G * math.sin(theta), turn * ARM + G * math.cos(theta), 0.0]
    assert found['linear_acceleration'] == pytest.approx(felt, abs=1e-8)
    assert found['angular_velocity'][:2].tolist() == [0.0, 0.0]
    assert found['angular_velocity'][2] ** 2 == pytest.approx(rate2, rel=1e-9)
    angle = Rotation.from_quat(found['orientation']).as_rotvec()
    assert angle == pytest.approx([0.0, 0.0, theta], abs=1e-10)
    # axes of the rod: centripetal force, and what the weight leaves across
    force = measured(pendulum(force_torque={'joint': 'pin'}), simulation)['force']
    centre = 0.5 * ARM
    wanted = [
        -2.0 * (rate2 * centre - G * math.sin(theta)),
        2.0 * (turn * centre + G * math.cos(theta)),
        0.0,
    ]
    assert force == pytest.approx(wanted, abs=1e-8)


def test_at_rest_an_accelerometer_feels_the_ground() -> None:
    scene = load_scene(
        {
            'mechanism': PENDULUM,
            'effects': {'gravity': {'acceleration': [0, -G]}},
            'sensors': {'imu': {'body': 'rod', 'at': [0.1, 0.2]}},
            'initial': {'positions': {'P': [0, -ARM]}},
        }
    )
    found = measured(scene, Simulation(scene))
    assert found['linear_acceleration'] == pytest.approx([-G, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize('name', ['rolling_disk', 'spatial_four_bar', 'delta_robot'])
def test_motion_in_space_against_differences_of_poses(name: str) -> None:
    """Central differences of fourth order of places and rotations, in steps of 1 ms."""
    plain = load_scene(name)
    body = next(b.name for b in plain.mechanism.bodies if len(b.points) + len(b.vectors) > 2)
    kinds = ('twist', 'acceleration', 'odometry', 'pose')
    more: dict[str, Any] = {kind: {'body': body} for kind in kinds}
    more['twist'] = {'world': {'body': body}, 'own': {'body': body, 'axes': 'body'}}
    more['imu'] = {'body': body, 'at': [0.1, -0.2, 0.3]}
    text = f'{plain.text}sensors: {more}\n'
    scene = scene_from_text(text.replace("'", ''))
    simulation = Simulation(scene, integrator='dop853', step=1e-3)
    simulation.step(298)
    n, h = simulation.model.body_names.index(body), 1e-3
    seen = []
    for _ in range(5):
        seen.append(poses(simulation.sample())[n])
        if len(seen) == 3:
            found = Sensors(scene).read(simulation.sample())
        simulation.step()
    turns = Rotation.from_quat([pose[3:] for pose in seen])
    first, second = np.array([1, -8, 0, 8, -1]) / 12.0, np.array([-1, 16, -30, 16, -1]) / 12.0
    place = np.array([pose[:3] for pose in seen])
    velocity, acceleration = first @ place / h, second @ place / h**2
    R, arm = turns.as_matrix(), np.array([0.1, -0.2, 0.3])
    spin = np.tensordot(first, R, 1) @ R[2].T / h
    omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    fall = np.array(next(e.parameters.acceleration for e in scene.effects if e.kind == 'gravity'))
    at = second @ (place + R @ arm) / h**2

    def near(wanted: Floats) -> Any:
        return pytest.approx(wanted, abs=1e-4, rel=1e-5)

    assert found['pose']['position'] == pytest.approx(place[2], abs=1e-12)
    assert found['twist/world']['linear_velocity'] == near(velocity)
    assert found['twist/world']['angular_velocity'] == near(omega)
    for label in ('twist/own', 'odometry'):
        assert found[label]['linear_velocity'] == near(R[2].T @ velocity)
        assert found[label]['angular_velocity'] == near(R[2].T @ omega)
    assert found['acceleration']['linear_acceleration'] == near(acceleration)
    assert found['imu']['angular_velocity'] == near(R[2].T @ omega)
    assert found['imu']['linear_acceleration'] == near(R[2].T @ (at - fall))


def test_an_encoder_counts_and_is_late() -> None:
    count, delay = 2.0 * math.pi / 500, 0.013
    scene = pendulum(encoder={'joint': 'pin', 'resolution': count, 'delay': delay})
    simulation, sensors, exact = Simulation(scene, step=1e-3), Sensors(scene), [0.0]
    for k in range(1, 200):
        simulation.step()
        sample = simulation.sample()
        exact.append(sample.joints['pin'].position)
        sensors.follow(sample)
        if k == 100:  # a number of an effect is changed
            sensors = sensors.in_scene(scene)
        if k % 7 == 0:
            (position,) = sensors.read(sample)['encoder']['position']
            if k > 13:
                assert position == count * math.floor(exact[k - 13] / count)
                assert 0.0 <= exact[k - 13] - position < count
    simulation.reset()  # time goes back: nothing is remembered
    assert sensors.read(simulation.sample())['encoder']['position'].tolist() == [0.0]


def test_a_delay_may_end_between_samples() -> None:
    """The encoder of a driven rack sent the position of the sample before that instant."""
    count, turn, radius = 1e-4, '40*t + 0.3*sin(5*t)', 0.05
    sensors = {
        'exact': {'joint': 'guide', 'delay': 0.0075},
        'counted': {'joint': 'guide', 'delay': 0.0023, 'resolution': count},
        'whole': {'joint': 'axle', 'delay': 0.015},
    }
    scene = load_scene(
        {
            'mechanism': 'rack_and_pinion',
            'drives': {'turn': {'joint': 'axle', 'angle': turn}},
            'sensors': {'encoder': sensors},
        }
    )

    def angle(t: float) -> float:
        return 40.0 * max(t, 0.0) + 0.3 * math.sin(5.0 * max(t, 0.0))

    simulation, read = Simulation(scene, step=1e-3, integrator='rk4'), Sensors(scene)
    for sample in simulation.run(2.0, every=5):
        found = read.read(sample)
        late = radius * angle(sample.t - 0.0075)
        assert found['encoder/exact']['position'] == pytest.approx([late], abs=1e-8)
        late = radius * angle(sample.t - 0.0023)
        assert -1e-8 <= late - found['encoder/counted']['position'] < count + 1e-8
        late = angle(sample.t - 0.015)
        assert found['encoder/whole']['position'] == pytest.approx([late], abs=1e-11)


def test_an_encoder_forgets_a_run_that_does_not_go_on() -> None:
    """It continued with positions of the run before, where a later state was restored."""
    scene = pendulum(encoder={'joint': 'pin', 'delay': 0.05})
    simulation, sensors = Simulation(scene, step=1e-3), Sensors(scene)
    simulation.step(1000)
    later = simulation.state
    position = simulation.sample().joints['pin'].position
    simulation.reset()
    for _ in range(100):
        simulation.step()
        sensors.follow(simulation.sample())
    simulation.restore(later)
    sensors.forget()
    for k in range(51):
        found = sensors.read(simulation.sample())['encoder']
        assert found['position'].tolist() == [position], k
        assert found['velocity'].tolist() == [0.0]
        simulation.step()
    assert sensors.read(simulation.sample())['encoder']['position'] != position


def test_a_range_is_infinite_outside_its_limits() -> None:
    for limits, wanted in (
        ({}, ARM),
        ({'max_range': 0.5}, math.inf),
        ({'min_range': 0.8}, -math.inf),
    ):
        scene = pendulum(range={'at': 'O', 'to': 'P', **limits})
        simulation = Simulation(scene)
        simulation.step(100)
        assert measured(scene, simulation)['range'] == pytest.approx([wanted], abs=1e-12)
        frame = Sensors(scene).frames['range'](simulation.sample())
        ahead = Rotation.from_quat(frame[3:]).apply([ARM, 0.0, 0.0])[:2]
        assert ahead == pytest.approx(simulation.sample().points['P'], abs=1e-12)


def test_noise_has_its_statistics_and_belongs_to_the_time() -> None:
    said = {
        'body': 'rod',
        'angular_velocity_noise': 0.02,
        'linear_acceleration_noise': 0.5,
        'linear_acceleration_bias': 3.0,
    }
    first, again, third = (Sensors(pendulum(imu={**said, 'seed': seed})) for seed in (1, 1, 2))
    clean = pendulum(imu={'body': 'rod'})
    simulation, without = Simulation(clean), Sensors(clean)

    def errors(noisy: tuple[Sensors, ...]) -> list[Floats]:
        sample = simulation.sample()
        exact, *found = (each.read(sample)['imu'] for each in (without, *noisy))
        keys = 'angular_velocity', 'linear_acceleration'
        return [np.concatenate([each[key] - exact[key] for key in keys]) for each in found]

    seen = []
    for _ in range(1500):
        simulation.step()
        seen.append(errors((first, third)))
    one, other = np.array(seen).transpose(1, 0, 2)
    assert abs(np.corrcoef(one[:, 0], other[:, 0])[0, 1]) < 0.12
    assert one.std(axis=0) == pytest.approx([0.02] * 3 + [0.5] * 3, rel=0.08)
    assert one.mean(axis=0)[:3] == pytest.approx(0.0, abs=4 * 0.02 / math.sqrt(1500))
    bias = np.abs(one.mean(axis=0)[3:])
    assert bias.max() > 0.2 and bias.max() < 12.0
    between = np.corrcoef(one.T)
    assert np.abs(between - np.eye(6)).max() < 0.12
    after = np.corrcoef(one[1:, 0], one[:-1, 0])[0, 1]
    assert abs(after) < 0.12
    state = simulation.state
    simulation.step(5)
    simulation.restore(state)
    assert np.array_equal(errors((again,))[0], one[-1])
    assert np.array_equal(errors((first,))[0], one[-1])


def test_no_two_instants_share_their_noise() -> None:
    """Other steps from half way on, and instants between steps. Step 50 of 2 ms had the noise of
    step 50 of 1 ms, and instants within a step had the same noise."""
    clean = pendulum(imu={'body': 'rod'})
    noise = {'angular_velocity_noise': 1.0, 'seed': 1}
    exact, noisy = Sensors(clean), Sensors(pendulum(imu={'body': 'rod', **noise}))

    def error(sample: Sample) -> float:
        found, true = (each.read(sample)['imu']['angular_velocity'] for each in (noisy, exact))
        return float(found[0] - true[0])

    fine, coarse = Simulation(clean, step=1e-3), Simulation(clean, step=2e-3)
    seen = [error(sample) for sample in fine.run(0.1)]
    coarse.restore(fine.state)
    last = seen[-1]
    seen[-1:] = [error(sample) for sample in coarse.run(0.1)]
    assert last in seen  # the same instant
    seen += [error(sample) for sample in Simulation(clean).run(0.01, at=[2e-4, 3e-4, 7e-4])]
    assert len(set(seen)) == len(seen) == 154


@pytest.mark.parametrize(
    ('sensors', 'message'),
    [
        ({'imus': {}}, "imus.*did you mean 'imu'|nearest.*imu"),
        ({'imu': {'body': 'rods'}}, 'rod'),
        ({'imu': {'body': 'rod', 'rate': 0}}, 'rate must be positive'),
        ({'imu': {'body': 'rod', 'at': 'Q'}}, 'Q'),
        ({'imu': {'body': 'rod', 'angular_velocity_noise': -1}}, 'must be zero or more'),
        ({'imu': {'body': 'rod', 'seed': 1.5}}, 'seed must be a whole number'),
        ({'encoder': {'joint': 'pin', 'resolution': 0}}, 'resolution must be positive'),
        ({'encoder': {'joint': 'pins'}}, 'pin'),
        ({'encoder': {'joint': 'pin', 'delay': 1e9}}, 'at most 60 s'),
        ({'encoder': {'joint': 'pin', 'rate': math.nan}}, 'rate'),
        ({'force_torque': {'joint': 'knee'}}, 'pin'),
        ({'range': {'at': 'O'}}, 'to'),
        ({'twist': {'body': 'rod', 'axes': 'mine'}}, 'world'),
    ],
)
def test_what_cannot_be_is_one_line(sensors: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        pendulum(**sensors)
    assert '\n' not in str(refused.value) and 'sensors' in str(refused.value)


def test_an_imu_needs_an_orientation() -> None:
    """How a rod between two balls turns about itself nothing tells: its rate of turn there was 0
    and belonged to no motion of its axes, and a place beside its line had any acceleration."""
    scene = load_scene('spatial_four_bar')
    rod = r'coupler is a rod that may turn about itself and has no orientation'
    with pytest.raises(InputError, match=rod) as refused:
        scene_from_text(f'{scene.text}sensors: {{imu: {{body: coupler, at: [0, 0.1, 0]}}}}\n')
    assert 'sensors.imu' in str(refused.value)
    scene = load_scene('scissor_lift')
    with pytest.raises(InputError, match='plate is a point and has no orientation'):
        scene_from_text(f'{scene.text}sensors: {{imu: {{body: plate}}}}\n')


def test_only_a_scene_has_sensors() -> None:
    with pytest.raises(InputError, match='scene: not a scene'):
        Sensors(Simulation(load_scene('four_bar')))  # type: ignore[arg-type]


def test_the_text_of_a_scene_has_its_sensors() -> None:
    scene = pendulum(imu={'left': {'body': 'rod'}, 'right': {'body': 'rod', 'rate': 100}})
    again = scene_from_text(scene.text)
    assert again.sensors == scene.sensors and again.hash == scene.hash
    assert [each.label for each in again.sensors] == ['imu/left', 'imu/right']
    assert pendulum().sensors == ()
