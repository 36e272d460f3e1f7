"""Arithmetic in input files: right values, and a short ExpressionError for everything else."""

import math
import time

import pytest

from alf_ros.scene.text.expression import ExpressionError, evaluate, reserved

NAMES = {'L': 2.0, 'm': 0.5, 'k': 3.0}


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('1', 1.0),
        ('-4.0', -4.0),
        ('+.5', 0.5),
        ('1.', 1.0),
        ('1e-3', 1e-3),
        ('1E+3', 1e3),
        ('1_000', 1000.0),
        ('007', 7.0),
        ('2 + 3*4', 14.0),
        ('(2 + 3)*4', 20.0),
        ('2**3**2', 512.0),
        ('-2**2', -4.0),
        ('7 // 2', 3.0),
        ('7 % 4', 3.0),
        ('L/m', 4.0),
        ('2*L*cos(pi/4)', 4.0 * math.cos(math.pi / 4)),
        ('hypot(3, 4) + abs(-1)', 6.0),
        ('atan2(1, -1)', math.atan2(1.0, -1.0)),
        ('min(L, m, k) + max(L, k)', 3.5),
        ('floor(2.7) + ceil(2.2)', 5.0),
        ('degrees(pi) - radians(180)', 180.0 - math.pi),
        ('sqrt(2)*exp(1)/e', math.sqrt(2.0) * math.exp(1.0) / math.e),
        ('log(8, 2)', 3.0),
        ('tau', math.tau),
        ('  L  ', 2.0),
        ('+'.join('1' * 90), 90.0),
    ],
)
def test_value(text: str, value: float) -> None:
    assert evaluate(text, NAMES) == pytest.approx(value, rel=1e-15)
    assert type(evaluate(text, NAMES)) is float


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', 'empty'),
        ('   ', 'empty'),
        ('2*', 'not arithmetic'),
        ('(1', 'not arithmetic'),
        ('1:30', 'not arithmetic'),
        ('0777 + 1', 'not arithmetic'),
        ('1 if L else 2', 'not arithmetic'),
        ('1 < 2', 'not arithmetic'),
        ('not L', 'not arithmetic'),
        ('L.real', 'not arithmetic'),
        ('(1, 2)', 'not arithmetic'),
        ('max(*L)', 'not arithmetic'),
        ('1j', 'not arithmetic'),
        ('True', 'not arithmetic'),
        ('__import__("os")', 'not arithmetic'),
        ('(lambda)', 'not arithmetic'),
        ('٣', 'not arithmetic'),
        ('1/0', 'division by zero'),
        ('1 % 0', 'division by zero'),
        ('0**-1', 'a function is not defined there'),
        ('sqrt(-1)', 'a function is not defined there'),
        ('(-8)**(1/3)', 'a function is not defined there'),
        ('sqrt()', 'wrong number of arguments'),
        ('atan2(1)', 'wrong number of arguments'),
        ('min(1)', 'wrong number of arguments'),
        ('sin', 'needs its argument'),
        ('9**9**9**9', 'too large'),
        ('exp(1000)', 'too large'),
        ('9' * 500, 'not a finite number'),
        ('1 + ' + '9' * 500, 'too large'),
        ('1e999', 'not a finite number'),
        ('1e999 - 1e999', 'not a finite number'),
        ('1e308*10', 'not a finite number'),
        ('nan', 'not a finite number'),
        ('-.inf', 'not a finite number'),
        ('1 + ' * 400 + '1', 'longer than 1000'),
        ('+'.join('1' * 300), 'nested too deeply'),
        ('(' * 300 + '1' + ')' * 300, 'not arithmetic|nested too deeply'),
        ('-' * 900 + '1', 'not arithmetic|nested too deeply'),
    ],
)
def test_refused(text: str, message: str) -> None:
    with pytest.raises(ExpressionError, match=message) as caught:
        evaluate(text, NAMES)
    assert len(str(caught.value)) < 80
    assert '\n' not in str(caught.value)


def test_unknown_name_comes_with_the_valid_ones() -> None:
    with pytest.raises(ExpressionError, match="unknown name 'LL'") as caught:
        evaluate('2*LL', NAMES)
    assert caught.value.name == 'LL'
    assert {'L', 'm', 'pi', 'sqrt'} <= set(caught.value.choices)


def test_unknown_function_comes_with_the_valid_ones() -> None:
    with pytest.raises(ExpressionError, match="unknown function 'eval'") as caught:
        evaluate('eval(1)', NAMES)
    assert caught.value.name == 'eval'
    assert 'sqrt' in caught.value.choices
    assert 'L' not in caught.value.choices


def test_no_text_takes_long() -> None:
    """Powers of powers are refused by their value, not by running out of time or memory."""
    start = time.process_time()
    for text in ('9**9**9**9**9', '(9**9**9)**(9**9)', '9**' * 40 + '9', 'exp(exp(exp(9)))'):
        with pytest.raises(ExpressionError):
            evaluate(text, {})
    assert time.process_time() - start < 1.0


def test_same_text_with_other_names() -> None:
    """The cache of parsed expressions must not include the values of their names."""
    assert [evaluate('k*L', {'L': 2.0, 'k': float(k)}) for k in range(3)] == [0.0, 2.0, 4.0]
    with pytest.raises(ExpressionError):
        evaluate('k*L', {'L': 2.0})


def test_reserved() -> None:
    assert all(map(reserved, ('pi', 'e', 'sin', 'lambda', 'None', 'nan', 'inf', 'Infinity')))
    assert not any(map(reserved, ('L', 'mass', 'E', 'x_1')))


@pytest.mark.parametrize('text', ['2**-1e9', '1e-400', '1e-200*1e-200', '1e-300/1e300', '-1e-400'])
def test_what_is_written_as_something_is_not_zero(text: str) -> None:
    with pytest.raises(ExpressionError, match='too small for a 64-bit number'):
        evaluate(text, {})


@pytest.mark.parametrize(
    'text', ['0*5', '5*0', '0/3', '0**2', '0.0e5', '-0', '7 // 8', '0*1e-300']
)
def test_zeros_are_zero(text: str) -> None:
    assert evaluate(text, {}) == 0.0


def test_forms_of_numbers() -> None:
    """None is read as YAML 1.1 would: octal, or to the base of 60."""
    forms = {'010': 10.0, '1_000': 1000.0, '0x10': 16.0, '0o10': 8.0}
    assert {text: evaluate(text, {}) for text in forms} == forms
    for text in ('1:30', '2*010'):
        with pytest.raises(ExpressionError, match='not arithmetic'):
            evaluate(text, {})
