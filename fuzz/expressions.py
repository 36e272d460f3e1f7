"""Expressions: arithmetic of names and functions, put together and damaged.

A value is a finite float, or there is one line. As a function of time it is what the value is.
"""

from __future__ import annotations

import math
from random import Random

from spoiling import damaged_text

SUFFIX = '.txt'
NAMES = {'L': 1.5, 'm': 2.0, 'k': 3.0, 'zero': 0.0, 'small': 1e-60, 'large': 1e40}
LEAVES = (
    '0 1 -1 2 0.5 1e-3 1e40 1e308 1e-308 pi e tau L m k zero small large t x 9 007 1_0 0x1'.split()
)
ONE = 'sqrt sin cos tan asin acos atan exp log floor ceil degrees radians abs'.split()
TWO = 'atan2 hypot log min max'.split()
SIGNS = '+ - * / ** // %'.split()


class Harness:
    SUFFIX = SUFFIX

    def make(self, random: Random) -> bytes:
        """An expression."""
        text = self._some(random, random.choice((1, 2, 3, 4, 30, 120)))
        for _ in range(random.choice((0, 0, 1, 2))):
            text = damaged_text(text, random)
        return text.encode('utf-8', 'surrogatepass')

    def _some(self, random: Random, depth: int) -> str:
        kind = random.randrange(8) if depth else 0
        if kind == 0:
            return random.choice(LEAVES)
        if depth > 10:  # deep, and narrow
            inner = self._some(random, depth - 1)
            return random.choice((f'({inner})', f'-{inner}', f'sin({inner})', f'{inner}+1', inner))
        if kind <= 3:
            left, right = (self._some(random, depth - 1) for _ in range(2))
            return f'({left}{random.choice(SIGNS)}{right})'
        if kind <= 5:
            return f'{random.choice(ONE)}({self._some(random, depth - 1)})'
        if kind == 6:
            left, right = (self._some(random, depth - 1) for _ in range(2))
            return f'{random.choice(TWO)}({left}, {right})'
        return f'-{self._some(random, depth - 1)}'

    def check(self, case: bytes) -> str:
        """Its value, and its value as a function of time."""
        from alf_ros.scene.text.expression import ExpressionError, evaluate, motion

        text = case.decode('utf-8', 'surrogatepass')
        try:
            value = evaluate(text, NAMES)
            assert isinstance(value, float) and math.isfinite(value), f'silent: {value!r}'
            end = 'ran'
        except ExpressionError as error:
            assert '\n' not in str(error) and len(str(error)) < 300
            end = 'refused'
        try:
            motion(text, NAMES)
            end = 'ran'
        except ExpressionError as error:
            assert '\n' not in str(error) and len(str(error)) < 300
        return end
