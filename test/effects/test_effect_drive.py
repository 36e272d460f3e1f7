"""Motors, drag and tables over time against responses with a closed form."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from alf_ros import InputError, Simulation, load_scene
from alf_ros.scene.scene import scene_from_text
from support.effect_scenes import DISC, MASS, ROTOR, ROTOR_IN_SPACE, TWO_ROTORS, simulate

J = 0.5


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_motor_runs_up_along_its_line(mechanism: str) -> None:
    """J ω̇ = L (1 - ω / ω₀)."""
    L, free = 2.0, 30.0
    sim = simulate(mechanism, f'motor: {{joint: pin, effort: 9, limit: {L}, free_speed: {free}}}')
    for sample in sim.run(4.0, every=400):
        omega = free * (1.0 - math.exp(-L * sample.t / (J * free)))
        assert sample.joints['pin'].velocity == pytest.approx(omega, abs=1e-9)


def test_speed_control_step_response() -> None:
    """J ω̇ = k_v (ω* - ω), at the limit first."""
    k, wanted, L = 2.0, 5.0, 4.0
    sim = simulate(
        ROTOR, f'motor: {{joint: pin, velocity: {wanted}, velocity_gain: {k}, limit: {L}}}'
    )
    free = wanted - L / k  # the speed at which it leaves the limit
    left = J * free / L
    for sample in sim.run(2.0, every=100):
        t = sample.t
        omega = L * t / J if t < left else wanted - L / k * math.exp(-k * (t - left) / J)
        # the step in which the limit ends is accurate to the first order of its kink
        assert sample.joints['pin'].velocity == pytest.approx(omega, abs=1e-5)


def test_position_control_step_response() -> None:
    """J θ̈ = k_p (θ* - θ) - k_v θ̇, more than a turn away."""
    kp, kv, wanted = 8.0, 0.6, 9.0
    gains = f'position_gain: {kp}, velocity_gain: {kv}'
    sim = simulate(ROTOR, f'motor: {{joint: pin, position: {wanted}, {gains}}}')
    decay = kv / (2.0 * J)
    omega = math.sqrt(kp / J - decay**2)
    for sample in sim.run(3.0, every=100):
        t = sample.t
        swing = math.cos(omega * t) + decay / omega * math.sin(omega * t)
        angle = wanted * (1.0 - math.exp(-decay * t) * swing)
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-9)


def test_motor_follows_a_ramp_with_its_slope() -> None:
    """The speed of a table of positions is its slope: no lag on a ramp but the start's."""
    kp, kv = 8.0, 4.0  # J s² + 4 s + 8: critically damped
    table = '[[0, 0], [2, 6], [2.5, 6]]'
    gains = f'position_gain: {kp}, velocity_gain: {kv}'
    sim = simulate(ROTOR, f'motor: {{joint: pin, position: {table}, {gains}}}')
    for sample in sim.run(2.0, every=200):
        angle = 3.0 * sample.t - 3.0 * sample.t * math.exp(-4.0 * sample.t)
        assert sample.joints['pin'].position == pytest.approx(angle, abs=1e-10)


@pytest.mark.parametrize('law', ['motor: {joint: pin,', 'tendon: {joints: [[pin, 1]],'])
def test_a_position_gain_of_zero_follows_the_slope(law: str) -> None:
    """J ω̇ = k_v (ẋ* - ω), which jumps at the rows; with the derivative by k_v."""
    kv, rows = 1.5, [(0.0, 0.5), (0.4, 1.1), (0.7, 0.2), (1.0, 0.2)]
    table = str([list(row) for row in rows])
    text = f'{law} position: {table}, position_gain: 0, velocity_gain: {kv}}}'
    gain = f'{text.partition(":")[0]}.velocity_gain'
    scene = simulate(ROTOR, text).scene
    sim = Simulation(scene, step=1e-3, integrator='dop853', tangents=[gain])

    def angle(k: float) -> float:
        x = v = 0.0
        for (a, low), (b, high) in pairwise(rows):
            slope, fade = (high - low) / (b - a), math.exp(-k * (b - a) / J)
            x += slope * (b - a) + (v - slope) * J / k * (1.0 - fade)
            v = slope + (v - slope) * fade
        return x

    sim.step(1000)
    sample = sim.sample()
    assert sample.joints['pin'].position == pytest.approx(angle(kv), abs=1e-9)
    change = (angle(kv + 1e-5) - angle(kv - 1e-5)) / 2e-5
    assert sample.tangents[gain].joints['pin'].position == pytest.approx(change, abs=1e-8)


def test_constant_wrench_on_a_point_and_on_a_body_that_spins() -> None:
    """A parabola; and a thrust that turns with its body: v = F / (m ω) (sin ω t, 1 - cos ω t)."""
    sim = simulate(MASS, 'constant_wrench: {on: P, force: [3, -1]}', 'P: [0.2, 0]')
    sim.step(1000)
    assert sim.sample().points['P'] == pytest.approx([1.0 + 0.2 + 0.75, -0.25], abs=1e-12)
    m, force, spin = 2.0, 3.0, 5.0
    thrust = f'constant_wrench: {{on: disc, force: [{force}, 0], frame: body}}'
    sim = simulate(DISC, thrust, f'C: [0, 0], R: [~, {spin}]')
    for sample in sim.run(2.0, every=250):
        turn = spin * sample.t
        wanted = force / (m * spin) * np.array([math.sin(turn), 1.0 - math.cos(turn)])
        assert sample.velocities['C'] == pytest.approx(wanted, abs=1e-10)
    sim = simulate(DISC, 'constant_wrench: {on: disc, torque: 0.03}')
    sim.step(1000)
    assert sim.sample().body_poses[0, 2] == pytest.approx(0.5 * 0.03 / 0.01, abs=1e-10)


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_effort_on_a_joint(mechanism: str) -> None:
    """J ω̇ = e."""
    sim = simulate(mechanism, 'joint_effort: {joint: pin, effort: 0.3}')
    sim.step(1000)
    assert sim.sample().joints['pin'].velocity == pytest.approx(0.3 / J, abs=1e-12)
    assert sim.sample().joints['pin'].position == pytest.approx(0.5 * 0.3 / J, abs=1e-12)


def test_motor_between_two_bodies_turns_both() -> None:
    sim = simulate(TWO_ROTORS, 'motor: {joint: pin, effort: 0.3}')
    sim.step(1000)
    sample = sim.sample()
    one, two = (sample.body_poses[n, 2] for n in (0, 1))
    assert one == pytest.approx(-0.5 * 0.3 / 0.5, abs=1e-12)
    assert two - 0.5 * math.pi == pytest.approx(0.5 * 0.3 / 0.25, abs=1e-12)


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_armature_is_inertia_of_the_joint(mechanism: str) -> None:
    """(J + I) ω̇ = e, and its energy counts."""
    sim = simulate(mechanism, 'motor: {joint: pin, effort: 0.3, armature: 0.7}')
    sim.step(1000)
    sample = sim.sample()
    omega = 0.3 / (J + 0.7)
    assert sample.joints['pin'].velocity == pytest.approx(omega, abs=1e-12)
    assert sample.energy == pytest.approx(0.5 * (J + 0.7) * omega**2, abs=1e-12)
    assert sample.diagnostics.redundant == 0


def test_armature_between_two_bodies() -> None:
    """I ẍ is what the effort has left for the bodies: ẍ = (e - I ẍ) (1 / J₁ + 1 / J₂)."""
    sim = simulate(TWO_ROTORS, 'motor: {joint: pin, effort: 0.3, armature: 0.2}')
    sim.step(1000)
    sample = sim.sample()
    both = 1 / 0.5 + 1 / 0.25
    acceleration = 0.3 * both / (1 + 0.2 * both)
    left = 0.3 - 0.2 * acceleration
    one, two = (sample.body_poses[n, 2] for n in (0, 1))
    assert one == pytest.approx(-0.5 * left / 0.5, abs=1e-12)
    assert two - 0.5 * math.pi == pytest.approx(0.5 * left / 0.25, abs=1e-12)
    assert sample.joints['pin'].effort == pytest.approx(0.3)
    assert sample.reactions['pin'].torque == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize('space', [False, True])
def test_armature_of_a_length(space: bool) -> None:
    """A carriage that a spindle drives: its rotor weighs as so many kilograms more."""
    zero = ', 0' if space else ''
    text = f"""
mechanism:
  alf: 1
  space: {'spatial' if space else 'planar'}
  points: {{A: {{at: [0, 0{zero}]}}, B: {{at: [1, 0{zero}]}}}}
  bodies: {{block: {{points: [A, B], mass: 2.0, inertia: {{about_com: J}}, com: [0, 0{zero}]}}}}
  joints: {{guide: {{type: prismatic, between: [ground, block], at: A, axis: [3, 4{zero}]}}}}
effects:
  motor: {{joint: guide, effort: 6.0, armature: 4.0}}
"""
    sim = Simulation(scene_from_text(text.replace('J', '[1, 1, 1]' if space else '1')), step=1e-3)
    sim.step(1000)
    assert sim.sample().joints['guide'].position == pytest.approx(0.5, abs=1e-12)


def test_no_armature_on_a_joint_of_two_angles() -> None:
    with pytest.raises(InputError, match='one of two angles'):
        load_scene(
            {
                'mechanism': {
                    'alf': 1,
                    'space': 'spatial',
                    'points': {'O': {'at': [0, 0, 0], 'fixed': True}, 'A': {'at': [1, 0, 0]}},
                    'bodies': {
                        'arm': {
                            'points': ['O', 'A'],
                            'mass': 1,
                            'inertia': {'about_com': [1, 1, 1]},
                            'com': [0.5, 0, 0],
                        }
                    },
                    'joints': {
                        'cross': {
                            'type': 'universal',
                            'between': ['ground', 'arm'],
                            'at': 'O',
                            'axes': [[0, 0, 1], [0, 1, 0]],
                        }
                    },
                },
                'effects': {'motor': {'joint': 'cross_first', 'effort': 1, 'armature': 1}},
            }
        )


def test_terminal_velocity() -> None:
    """m v̇ = m g - c v²: v = v_t tanh (g t / v_t); and with b alone, against the wind."""
    m, g, c, b, w = 2.0, 9.81, 0.5, 3.0, 4.0
    gravity = f'gravity: {{acceleration: [0, -{g}]}}'
    sim = simulate(MASS, f'{gravity}, drag: {{on: mass, quadratic: {c}}}')
    terminal = math.sqrt(m * g / c)
    for sample in sim.run(2.0, every=200):
        fall = terminal * math.tanh(g * sample.t / terminal)
        assert sample.velocities['P'] == pytest.approx([0.0, -fall], abs=1e-11)
    sim = simulate(MASS, f'drag: {{on: P, linear: {b}, wind: [{w}, 0]}}', 'P: [-1, 2]')
    for sample in sim.run(2.0, every=200):
        left = math.exp(-b * sample.t / m)
        assert sample.velocities['P'] == pytest.approx([w - (w + 1) * left, 2 * left], abs=1e-11)


@pytest.mark.parametrize('mechanism', [ROTOR, ROTOR_IN_SPACE])
def test_drag_of_rotation(mechanism: str) -> None:
    """J ω̇ = -s ω."""
    rest = ', ~' * (mechanism is ROTOR_IN_SPACE)
    sim = simulate(mechanism, 'drag: {on: rotor, spin: 0.4}', f'A: [~, 7{rest}]')
    for sample in sim.run(1.0, every=100):
        omega = 7.0 * math.exp(-0.4 * sample.t / J)
        assert sample.joints['pin'].velocity == pytest.approx(omega, abs=1e-11)


ROWS = [[0.0, 0.0, 1.0], [0.4, 3.0, -2.0], [0.6, -1.0, 0.5], [1.0, 2.0, 2.0]]


@pytest.mark.parametrize('interpolation', ['linear', 'cubic'])
def test_table_over_time(interpolation: str) -> None:
    """The momentum gained is the integral of the table, held beyond its end."""
    m = 2.0
    table = f'user_table: {{on: mass, table: {ROWS}, interpolation: {interpolation}}}'
    sim = simulate(MASS, table)
    t, F = np.array(ROWS)[:, 0], np.array(ROWS)[:, 1:]
    for sample in sim.run(1.5, every=100):
        end = min(sample.t, 1.0)
        if interpolation == 'cubic':
            gained = CubicSpline(t, F, bc_type='natural').integrate(0.0, end)
        else:
            inner = np.unique(np.concatenate([t[t < end], [end]]))
            values = np.column_stack([np.interp(inner, t, column) for column in F.T])
            gained = 0.5 * (np.diff(inner)[:, None] * (values[1:] + values[:-1])).sum(axis=0)
        gained = gained + max(0.0, sample.t - 1.0) * F[-1]
        assert sample.velocities['P'] == pytest.approx(gained / m, abs=1e-12)


def test_table_in_a_file_goes_into_the_text(tmp_path: Path) -> None:
    """Columns with a title and remarks; the scene's text needs the file no more."""
    lines = ['# a remark', 't, fx, fy', *(', '.join(map(str, row)) for row in ROWS)]
    (tmp_path / 'push.csv').write_text('\n'.join(lines) + '\n')
    text = f'{MASS}\neffects:\n  user_table:\n    push: {{on: mass, table: push.csv}}\n'
    (tmp_path / 'scene.yaml').write_text(text)
    scene = load_scene(tmp_path / 'scene.yaml')
    again = scene_from_text(scene.text)
    assert again.effects == scene.effects and again.hash == scene.hash
    (tmp_path / 'push.csv').unlink()
    sims = Simulation(scene), Simulation(again)
    for sim in sims:
        sim.step(500)
    assert sims[0].state.q.tobytes() == sims[1].state.q.tobytes()
    assert sims[0].sample().velocities['P'][0] > 0.1


@pytest.mark.parametrize(
    'lines, message',
    [
        ('0, 1, 2\n1, x, 3\n', r'push\.csv:2: not a row of numbers'),
        ('0, 1, 2\n1, 3\n', r'push\.csv:2: wrong number of columns; expected 3'),
        ('a, b\nc, d\n', r'push\.csv:2: not a row'),
        ('0, 1, nan\n', r'push\.csv:1: not a row'),
        ('# nothing\n', r'push\.csv: no numbers'),
        (None, r'push\.csv: no such file'),
    ],
)
def test_bad_file_of_numbers(tmp_path: Path, lines: str | None, message: str) -> None:
    if lines is not None:
        (tmp_path / 'push.csv').write_text(lines)
    text = f'{MASS}\neffects: {{user_table: {{on: mass, table: push.csv}}}}\n'
    (tmp_path / 'scene.yaml').write_text(text)
    with pytest.raises(InputError, match=message):
        load_scene(tmp_path / 'scene.yaml')
