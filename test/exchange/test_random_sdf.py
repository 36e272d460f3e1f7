"""Random SDF with frames of all kinds move as MuJoCo has the same bodies."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alf_ros import Simulation
from alf_ros.arrays import Floats
from alf_ros.exchange.import_file import imported
from alf_ros.exchange.robot import FramePose
from alf_ros.scene.scene import scene_from_text
from support.imported_motions import saved
from support.random_sdf import RandomTree
from support.thorough import combined

mujoco = pytest.importorskip('mujoco')

STEP, DURATION = 5e-4, 0.2  # s
VERSIONS = ('1.4', '1.5', '1.6', '1.7', '1.9', '1.12')


def displacement(before: FramePose, after: FramePose) -> Floats:
    """(3, 4) of the world: it does not depend on the frame of the body that moves."""
    moved = after @ before.inverse
    return np.column_stack([moved.turn, moved.origin])


def ours(simulation: Simulation) -> dict[str, FramePose]:
    names = [body.name for body in simulation.scene.mechanism.bodies]
    poses = simulation.sample().body_poses
    turns = Rotation.from_quat(poses[:, 3:]).as_matrix()
    return {n: FramePose(*each) for n, *each in zip(names, poses[:, :3], turns, strict=True)}


def theirs(data: object, tree: RandomTree) -> dict[str, FramePose]:
    return {
        re.sub(r'\W', '_', link): FramePose(
            data.body(link).xpos.copy(),  # type: ignore[attr-defined]
            data.body(link).xmat.reshape(3, 3).copy(),  # type: ignore[attr-defined]
        )
        for link in tree.links
    }


@pytest.mark.parametrize(('version', 'seed'), combined(VERSIONS, range(6)))
def test_it_moves_as_its_bodies(version: str, seed: int, tmp_path: Path) -> None:
    tree = RandomTree(seed, version, tmp_path)
    text = imported(saved(tmp_path, 'it.sdf', tree.sdf()), scene=True)
    assert 'joints of unknown type' not in text
    simulation = Simulation(scene_from_text(text), integrator='dop853', step=1e-3)
    option = f'timestep="{STEP}" integrator="RK4" gravity="0 0 -9.8"'
    data = mujoco.MjData(model := mujoco.MjModel.from_xml_string(tree.mjcf(option)))
    mujoco.mj_forward(model, data)
    starts = ours(simulation), theirs(data, tree)
    for _ in range(round(DURATION / STEP)):
        mujoco.mj_step(model, data)
    simulation.step(round(DURATION / 1e-3))
    ends = ours(simulation), theirs(data, tree)
    assert starts[0].keys() <= starts[1].keys()
    for name in starts[0]:  # fixed links are one body, of the name of the heaviest
        found, expected = (
            displacement(start[name], end[name]) for start, end in zip(starts, ends, strict=True)
        )
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7)
    assert max(np.abs(end.origin - starts[0][n].origin).max() for n, end in ends[0].items()) > 1e-3
