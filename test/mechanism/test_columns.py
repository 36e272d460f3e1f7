"""Numbers of many members at once: each has the bits of its own computation."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from alf_ros import Scene, Simulation, columns, load_scene, resources
from alf_ros.columns import Column, Divided
from alf_ros.errors import AlfError, InputError
from alf_ros.mechanism.memory import remembered
from alf_ros.scene import overrides
from alf_ros.scene.text.expression import ExpressionError, evaluate
from alf_ros.scene.text.yaml_document import Entry
from alf_ros.simulation.member_numbers import Likeness, is_same, unlike
from support.some_scenes import SOME_SCENES
from support.thorough import LONG

MEMBERS = 9
RANDOM = np.random.default_rng(5)


def some(*shape: int, low: float = -2.0) -> Any:
    """An array of columns, and the arrays of the members."""
    numbers = RANDOM.uniform(low, 2.0, (MEMBERS, *shape))
    found = np.empty(math.prod(shape), dtype=object)
    for n, values in enumerate(numbers.reshape(MEMBERS, -1).T):
        found[n] = Column(values.copy())
    return found.reshape(shape), numbers


def bits(found: Any) -> bytes:
    return np.ascontiguousarray(columns.spread(np.array(found), MEMBERS)).tobytes()


@pytest.mark.parametrize(
    'text',
    ['x + 2*y', '1 - x/y', '-x * +y', '(x - y)/3', 'x**2 - 2**y', 'hypot(x, y)', 'max(x, y, 1)']
    + ['sin(x)*cos(y)', 'abs(x) + atan2(y, x)', 'sqrt(x*x + y*y)', 'floor(x)', '3', 'min(2, x)'],
)
def test_an_expression_has_the_bits_of_each_member(text: str) -> None:
    x, y = (Column(RANDOM.uniform(0.1, 2.0, MEMBERS)) for _ in 'xy')
    found = evaluate(text, {'x': x, 'y': y})  # type: ignore[dict-item]
    pairs = zip(x.values.tolist(), y.values.tolist(), strict=True)
    alone = np.array([evaluate(text, {'x': a, 'y': b}) for a, b in pairs])
    assert bits([found]) == alone.tobytes()


def test_a_number_that_is_none_belongs_to_some_members() -> None:
    x = Column(np.array([1.0, 0.0, 2.0, 1e200]))
    for text, good in (('1/x', [0, 2, 3]), ('log(x)', [0, 2, 3]), ('x*x', [0, 1, 2])):
        with pytest.raises(Divided) as error:
            evaluate(text, {'x': x})  # type: ignore[dict-item]
        assert np.flatnonzero(error.value.agreeing).tolist() == good
    for text in ('x // 2', 'x % 2', 'sin(x, x)'):
        with pytest.raises(ExpressionError):
            evaluate(text, {'x': x})  # type: ignore[dict-item]


def test_comparisons_are_those_of_all_members_or_divide_them() -> None:
    x = Column(np.array([1.0, 2.0, 3.0]))
    assert x > 0 and x >= 1.0 and not x < 0.5 and x <= 3 and x == x and x != 5.0 and x
    assert x != 'x' and x in (5.0, x) and abs(-x) == +x
    with pytest.raises(Divided) as error:
        _ = x < 2.5
    assert error.value.agreeing.tolist() == [True, True, False]
    with pytest.raises(Divided) as error:
        _ = 2.5 > 2.0 * x  # of two parts the larger one
    assert error.value.agreeing.tolist() == [False, True, True]
    with pytest.raises(TypeError):
        float(x)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        np.array([x], dtype=float)


@pytest.mark.parametrize(
    ('first', 'second'),
    [((2,), (2,)), ((3,), (3,)), ((2, 2), (2,)), ((3, 3), (3,)), ((2,), (2, 2)), ((3, 3), (3, 3))]
    + [((2, 3), (3, 2)), ((1, 2), (2,)), ((2, 2), (1, 2, 2)), ((1, 3, 3), (3, 3))],
)
@pytest.mark.parametrize('turned', [False, True])
def test_products_have_the_bits_of_each_member(
    first: tuple[int, ...], second: tuple[int, ...], turned: bool
) -> None:
    for one, other in (
        (some(*first), some(*second)),
        (some(*first), RANDOM.normal(size=second)),
        (RANDOM.normal(size=first), some(*second)),
    ):
        a, b = (each if isinstance(each, tuple) else (each, [each] * 9) for each in (one, other))
        (x, xs), (y, ys) = a, b
        if turned and x.ndim == 2 and x.shape[0] == x.shape[1]:
            x, xs = x.T, [each.T for each in xs]
        alone = [p @ q for p, q in zip(xs, ys, strict=True)]
        assert bits(columns.dot(x, y)) == np.array(alone).tobytes()


def test_functions_of_arrays_have_the_bits_of_each_member() -> None:
    for D in (2, 3):
        vector, vectors = some(D)
        assert bits([columns.norm(vector)]) == np.array([*map(np.linalg.norm, vectors)]).tobytes()
        for k in (1, D):
            matrix, matrices = some(k, D)
            alone = np.array([np.linalg.pinv(each.T) for each in matrices])
            assert bits(columns.pseudoinverse(matrix.T)) == alone.tobytes()
        places, every = some(4, D)
        alone = np.array([np.ptp(each, axis=0).max() for each in every])
        assert bits([columns.extent(places)]) == alone.tobytes()
        alone = np.array([math.dist(each[0], each[1]) for each in every])
        assert bits([columns.distance(places[0], places[1])]) == alone.tobytes()
        alone = np.array([math.hypot(*each) for each in vectors])
        assert bits([columns.each(math.hypot, *vector)]) == alone.tobytes()
    numbers, every = some(4)
    assert bits([columns.largest(numbers)]) == every.max(axis=1).tobytes()
    assert columns.largest([]) == 0.0 and columns.largest([1.0, 3.0]) == 3.0


def test_nothing_is_remembered_of_many_members() -> None:
    asked: list[object] = []

    @remembered(8)
    def noted(value: object) -> int:
        asked.append(value)
        return len(asked)

    x, _ = some(2)
    for value in (x, tuple(x), (1.0, 2.0)):
        noted(value)
        noted(value)
    assert len(asked) == 5


def test_members_of_the_library_are_read_together() -> None:
    """Masses always; lengths where rounding does not decide whether coefficients are zero."""
    with_lengths = set()
    some = {*SOME_SCENES, 'double_pendulum', 'excavator', 'four_bar'}
    for name in sorted(resources.library('scenes') if LONG else some):
        scene = load_scene(name)
        if len(scene.mechanism.bodies) > 30 or unlike(Simulation(scene)):
            continue
        assert _read(scene, {f'mechanism.bodies.{b}.mass': m for b, m in _masses(scene)}), name
        fields = scene.document.root.mapping()['mechanism'].mapping()
        written = fields['parameters'].mapping() if 'parameters' in fields else {}
        values = {key: entry.number({}) for key, entry in written.items() if _plain(entry)}
        if values and _read(scene, values):
            with_lengths.add(name)
    assert with_lengths >= {'double_pendulum', 'excavator', 'four_bar', 'slider_crank'}


def _plain(entry: Entry) -> bool:
    """Whether it is a number by itself, and no count."""
    text = entry.value
    return isinstance(text, str) and re.fullmatch(r'[0-9]+\.[0-9]+', text) is not None


def _masses(scene: Scene) -> list[tuple[str, float]]:
    written = scene.document.root.mapping()['mechanism'].mapping()['bodies'].mapping()
    return [(b.name, b.mass) for b in scene.mechanism.bodies if b.name in written and b.mass][:2]


def _read(scene: Scene, numbers: dict[str, float]) -> int:
    """How many members with other numbers are read together; each has its bits."""
    if not numbers:  # written for several bodies at once
        return MEMBERS
    changes = [
        {name: repr(x * RANDOM.uniform(0.99, 1.01)) for name, x in numbers.items()}
        for _ in range(MEMBERS)
    ]
    try:
        scenes = [overrides.with_changes(scene, each) for each in changes]
        like = Likeness(Simulation(scenes[0]))
    except AlfError:
        return 0  # these numbers depend on each other
    try:
        together = overrides.of_members(scene, changes)
        found = together and like.numbers_of_columns(together, MEMBERS)
    except (Divided, InputError):
        return 0
    alone = [like.numbers_of(each) for each in scenes]
    assert found and all(is_same(a, b) for a, b in zip(found, alone, strict=True))
    return len(found)
