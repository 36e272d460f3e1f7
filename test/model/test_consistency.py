"""Redundant lengths that miss what the mechanism needs by a little: adjusted, or refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from alf_ros import AssemblyError, Simulation, load_scene
from alf_ros.arrays import Floats
from alf_ros.inspection.answer import BAD, NOTE
from alf_ros.inspection.soundness import examine
from support.hinge_loop import hinge_loop
from support.other_units import Units, in_units
from support.thorough import LONG, combined, thinned

STEPS = {'rk4': 1e-3, 'dop853': 5e-3, 'dop853_adaptive': 1e-2, 'esdirk43': 5e-3}


def wheels(error: float, seed: int = 1) -> dict[str, Any]:
    """Three equal cranks and the rod of a locomotive, with lengths off by about `error`: one crank
    is redundant."""
    random = np.random.default_rng(seed)
    points: dict[str, Any] = {}
    for k in range(3):
        x = 0.7 * k + error * random.standard_normal()
        length = 0.3 * (1.0 + error * random.standard_normal())
        points[f'A{k}'] = {'at': [x, 0.0], 'fixed': True}
        at = [x + length * math.cos(-1.1), length * math.sin(-1.1)]
        points[f'B{k}'] = {'at': at}
    bodies = {
        f'crank{k}': {'points': [f'A{k}', f'B{k}'], 'mass': 1.0, 'inertia': 'rod'}
        for k in range(3)
    }
    bodies['rod'] = {'points': ['B0', 'B2', 'B1'], 'mass': 2.0, 'inertia': 'rod'}
    joints = {}
    for k in range(3):
        joints[f'pin{k}'] = {
            'type': 'revolute',
            'between': ['ground', f'crank{k}'],
            'at': f'A{k}',
        }
        joints[f'top{k}'] = {'type': 'revolute', 'between': ['rod', f'crank{k}'], 'at': f'B{k}'}
    return {
        'mechanism': {
            'alf': 1,
            'space': 'planar',
            'points': points,
            'bodies': bodies,
            'joints': joints,
        },
        'effects': {'gravity': {'acceleration': [0.0, -9.81]}},
    }


def bricard(digits: int) -> dict[str, Any]:
    """Bricard's mechanism turned in space, with coordinates of so many digits."""
    c, s = math.cos(0.3), math.sin(0.3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array(
        [[1, 0, 0], [0, c, -s], [0, s, c]]
    )
    places = np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [1, -1, 1], [0, -1, 1], [0, 0, 1]])
    axes = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0]])
    at, along = (np.round(each @ turn.T, digits) for each in (places, axes))
    return hinge_loop(at, along, down=turn @ [0.0, -9.81, 0.0])


def run(scene: dict[str, Any], integrator: str, **options: Any) -> tuple[Simulation, Floats]:
    """The simulation after 2 s, and its energies (J) on the way."""
    sim = Simulation(load_scene(scene), integrator=integrator, step=STEPS[integrator], **options)
    every = round(0.1 / sim.h)
    return sim, np.array([sample.energy for sample in sim.run(2.0, every=every)])


@pytest.mark.parametrize(
    ('error', 'integrator'),
    combined(thinned([1e-13, 1e-12, 1e-11, 1e-10, 1e-9], [1e-13, 1e-11, 1e-9]), STEPS),
)
def test_redundant_cranks_are_made_equal(error: float, integrator: str) -> None:
    exact, energies = run(wheels(0.0), integrator)
    sim, found = run(wheels(error), integrator)
    assert exact.adjustment is None and sim.adjustment is not None
    assert 0.1 * error < sim.adjustment.gap < 3.0 * error
    assert max(sim.adjustment.changes.values()) < 3.0 * error
    assert np.ptp(found) < 2.0 * np.ptp(energies) + 1e-11
    assert sim.evaluations <= 1.01 * exact.evaluations
    assert sim.sample().q == pytest.approx(exact.sample().q, abs=100.0 * error + 1e-11)
    # the rod may turn by as little as the outer cranks differ: the middle one is their mean
    one, middle, other = (body.local[1][0] for body in sim.model.mechanism.bodies[:3])
    assert one - 2.0 * middle + other == pytest.approx(0.0, abs=2e-15 + error**2)


@pytest.mark.parametrize('digits', [12, 9])
@pytest.mark.parametrize('integrator', ['dop853', 'dop853_adaptive'])
def test_a_mechanism_in_space_with_rounded_coordinates(digits: int, integrator: str) -> None:
    exact, energies = run(bricard(17), integrator)
    sim, other = run(bricard(digits), integrator)
    assert sim.adjustment is not None
    assert max(sim.adjustment.changes.values()) < 3.0 * 10.0**-digits
    assert np.ptp(other) < 2.0 * np.ptp(energies) + 1e-11
    assert sim.evaluations <= 1.01 * exact.evaluations


def bricard_and_nut() -> dict[str, Any]:
    """A nut on a thread, whose row binds velocities, beside a mechanism of rounded lengths."""
    scene = bricard(9)
    mechanism = scene['mechanism']
    mechanism['points'] |= {'N': {'at': [3.0, 0.0, 0.0]}}
    mechanism['bodies'] |= {
        'nut': {'points': ['N'], 'mass': 1.0, 'inertia': {'about_com': [1.0, 1.0, 1.0]}}
    }
    mechanism['joints'] |= {
        'thread': {
            'type': 'screw',
            'between': ['ground', 'nut'],
            'at': 'N',
            'axis': [0, 0, 1],
            'pitch': 0.5,
        }
    }
    return scene


def test_rows_that_bind_velocities_stay_as_they_are() -> None:
    scene = bricard_and_nut()
    sim = Simulation(load_scene(scene), step=1e-2)
    alone = Simulation(load_scene(bricard(9)), step=1e-2)
    assert sim.adjustment is not None and alone.adjustment is not None
    assert sim.adjustment.changes.get('thread', 0.0) < 1e-30
    assert sim.adjustment.gap == pytest.approx(alone.adjustment.gap, rel=0.5)
    sim.step(100)
    lead = 0.5 / (2.0 * math.pi)  # m/rad; s'' = g_z / (1 + J / (m lead^2))
    fall = 0.5 * scene['effects']['gravity']['acceleration'][2] / (1.0 + 1.0 / lead**2)
    assert sim.sample().points['N'][2] == pytest.approx(fall, abs=1e-9)


@pytest.mark.parametrize('metre', [2.0**10, 2.0**-10])
def test_lengths_in_other_units_are_adjusted_alike(metre: float) -> None:
    """In millimetres they were refused, as if they contradicted each other."""
    scene = load_scene(bricard_and_nut())
    own = Simulation(scene, step=1e-2).adjustment
    other = Simulation(in_units(scene, Units(metre, 1.0, 1.0)), step=1e-2).adjustment
    assert own is not None and other is not None
    assert other.gap == pytest.approx(metre * own.gap, rel=0.2)


def test_the_adjustment_is_stated_and_repeats() -> None:
    one, two = (Simulation(load_scene(wheels(1e-10))) for _ in range(2))
    text = str(one.adjustment)
    assert 'crank1 by' in text and 'contradict each other by' in text
    assert text == str(two.adjustment)
    assert one.model.mechanism == two.model.mechanism


@pytest.mark.parametrize('error', [1e-7, 1e-6, 1e-5])
def test_lengths_that_differ_by_more_are_refused_by_name(error: float) -> None:
    with pytest.raises(AssemblyError, match='redundant constraints contradict.*crank1_length by'):
        Simulation(load_scene(wheels(error)))


def test_check_tells_what_is_adjusted_and_what_is_refused() -> None:
    found = examine(load_scene(wheels(1e-10)))
    (told,) = (a for a in found.answers if a.question == 'redundant lengths')
    assert found.sound and told.verdict == NOTE
    assert told.answer == str(Simulation(load_scene(wheels(1e-10))).adjustment)
    found = examine(load_scene(wheels(1e-6)))
    (told,) = (a for a in found.answers if a.question == 'start')
    assert told.verdict == BAD and 'crank1_length by' in told.answer
    if LONG:
        found = examine(load_scene(wheels(0.0)))
        assert found.sound and all(a.question != 'redundant lengths' for a in found.answers)


@pytest.mark.parametrize('name', ['bricard', 'double_wishbone', 'planetary_gear', 'scissor_lift'])
def test_exact_mechanisms_stay_as_they_are(name: str) -> None:
    sim = Simulation(load_scene(name))
    assert sim.adjustment is None
    assert sim.model.mechanism is sim.scene.mechanism


@pytest.mark.parametrize('stages', [4, 5, 6, 7])
def test_exact_scissors_stay_as_they_are(stages: int) -> None:
    """At the top many modes vanish together, and guesses are off the branch."""
    assert Simulation(load_scene('scissor_lift', {'N': stages})).adjustment is None


def telescope(seed: int, guides: int) -> dict[str, Any]:
    """A crank, a slide on it, and a slide on that with one or two guides 3 cm apart, at random."""
    random = np.random.default_rng(seed)

    def unit() -> Floats:
        angle = random.uniform(0.0, 2.0 * math.pi)
        return np.array([math.cos(angle), math.sin(angle)])

    along, inward = unit(), unit()
    S, X = random.uniform(-1.0, 1.0, (2, 2))
    at = {'A': 0.45 * unit(), 'S': S, 'T': S + 0.4 * unit(), 'X': X, 'Y': X + 0.4 * unit()}
    at['Z'] = X + 0.03 * inward
    points: dict[str, Any] = {name: {'at': place.tolist()} for name, place in at.items()}
    points['O'] = {'at': [0.0, 0.0], 'fixed': True}
    rod = {'mass': 1.0, 'inertia': 'rod'}
    bodies = {
        'crank': {'points': ['O', 'A'], **rod},
        'first': {'points': ['S', 'T'], **rod},
        'second': {'points': ['X', 'Y', 'Z'], **rod},
    }
    joints: dict[str, Any] = {
        'pin': {'type': 'revolute', 'between': ['ground', 'crank'], 'at': 'O'},
        'guide': {'type': 'prismatic', 'between': ['crank', 'first'], 'at': 'S'},
    }
    joints['guide']['axis'] = along.tolist()
    for place in ['X', 'Z'][:guides]:
        slide = {'type': 'prismatic', 'between': ['first', 'second'], 'at': place}
        joints[f'inner_{place}'] = {**slide, 'axis': inward.tolist()}
    mechanism = {'alf': 1, 'points': points, 'bodies': bodies, 'joints': joints}
    return {'mechanism': mechanism, 'effects': {'gravity': {'acceleration': [0.0, -9.81]}}}


@pytest.mark.parametrize('seed', [0, 3, 4])
def test_slides_may_be_pulled_out_far(seed: int) -> None:
    """Gaps that rounding leaves grow with the square of the way. They were taken for lengths that
    contradict each other."""
    places = []
    for guides in (1, 2):
        sim = Simulation(telescope(seed, guides), step=1e-2, integrator='dop853')
        assert sim.adjustment is None
        sim.step(30)
        places.append(sim.sample().points['Y'])
    assert places[1] == pytest.approx(places[0], abs=1e-11)


def test_a_driven_crank_stays_driven() -> None:
    scene = wheels(1e-10)
    scene['drives'] = {'turn': {'joint': 'pin0', 'angle': '-1.1 + 0.5*sin(3*t)'}}
    sim = Simulation(load_scene(scene), step=1e-2)
    sim.step(100)
    sample = sim.sample()
    assert sim.adjustment is not None
    assert sample.diagnostics.position_violation < 1e-14
    place = sample.joint_positions[sim.model.coordinate_names.index('pin0')]
    assert place == pytest.approx(-1.1 + 0.5 * math.sin(3.0), abs=1e-9)
