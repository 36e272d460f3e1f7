"""A harness whose cases go wrong in every way there is."""

import os
import re
import signal
import time
from random import Random


class Harness:
    SUFFIX = '.txt'
    SECONDS, PATIENCE = 0.5, 2.0

    def make(self, random: Random) -> bytes:
        # as the worker seeds it: the number of the case is told by nothing else
        return self.numbered(random)

    @staticmethod
    def numbered(random: Random) -> bytes:
        state = random.getstate()
        for number in range(100):
            if Random(f'support.misbehaving {number}').getstate() == state:
                return b'%d' % number
        raise AssertionError

    def check(self, case: bytes) -> str:
        number = int(case)
        if number == 3:
            re.match('(a*)*b', 'a' * 40)
        elif number == 7:
            os.kill(os.getpid(), signal.SIGSEGV)
        elif number == 11:
            bytearray(1 << 40)
        elif number == 13:
            raise SystemExit(0)
        elif number == 17:
            raise KeyError('x')
        elif number == 19:
            raise AssertionError('silent: another number')
        elif number == 23:
            time.sleep(1e6)
        return 'ran'
