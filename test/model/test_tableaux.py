"""The numbers of the methods, and that a start does not pay for where they could come from."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from scipy.integrate import DOP853

from alf_ros.model import dormand_prince

PROGRAM = """
import sys
from alf_ros import Simulation, load_scene
Simulation(load_scene('slider_crank')).step(1)
heavy = ('optimize', 'integrate', 'interpolate')
print([name for name in heavy if f'scipy.{name}' in sys.modules])
"""


def test_dop853_is_the_one_of_scipy() -> None:
    for ours, theirs in (
        (dormand_prince.A, DOP853.A),
        (dormand_prince.B, DOP853.B),
        (dormand_prince.C, DOP853.C),
        (dormand_prince.ERROR_5, DOP853.E5[:-1]),
        (dormand_prince.ERROR_3, DOP853.E3[:-1]),
    ):
        assert np.array_equal(ours, theirs)


def test_a_scene_without_splines_starts_without_integrators_optimisers_and_splines() -> None:
    done = subprocess.run([sys.executable, '-c', PROGRAM], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ('[]\n', '')
