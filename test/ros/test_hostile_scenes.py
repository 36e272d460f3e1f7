"""Scenes that are loaded while the node runs: their code runs only if `trust_scenes` is set."""

from __future__ import annotations

import hashlib

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

from support.ros_node import SimulatorProcess

LIFT = """
from dataclasses import dataclass, field
import pathlib
import numpy as np
from alf_ros.effects.contract import Packed, force

pathlib.Path({owned!r}).write_text('owned')
MULTIPLE = False

@dataclass(frozen=True)
class Parameters:
    strength: float = field(metadata={{'kind': 'number', 'unit': 'N', 'doc': 'upwards'}})

def pack(effects, layout):
    return Packed(np.zeros(0, np.int64), np.array([effects[0].parameters.strength]))

@force
def force(t, q, qd, near, slots, params, Q):
    Q[1] += params[0]
"""


def loaded(peer, scene):
    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(scene))
    parameter = Parameter(name='scene', value=value)
    answer = peer.call(SetParameters, '/simulator/set_parameters', parameters=[parameter])
    return answer.results[0]


@pytest.mark.parametrize('trust', ['false', 'true'])
def test_a_scene_loaded_at_run_time_brings_code_only_if_trusted(peer, tmp_path, trust):
    owned, file = tmp_path / 'owned', tmp_path / 'lift.py'
    file.write_text(LIFT.format(owned=str(owned)))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    scenes = []
    for k, name in enumerate(('lift.py', f'{file}#sha256={digest}')):
        scenes.append(tmp_path / f'scene_{k}.yaml')
        scenes[-1].write_text(f"mechanism: slider_crank\neffects: {{'{name}': {{strength: 1}}}}\n")
    secret = tmp_path / 'secret.yaml'
    secret.write_text('hunter2\n')
    node = SimulatorProcess(tmp_path / 'node', '--no-record', trust_scenes=trust)
    with node.wait_running():
        for scene in scenes:
            result = loaded(peer, scene)
            assert result.successful == owned.exists() == (trust == 'true'), result.reason
            if trust == 'false':
                assert 'lift.py' in result.reason and 'code' in result.reason
        assert not (answer := loaded(peer, secret)).successful and 'hunter2' not in answer.reason
        assert node.stop() == 0, node.output


def test_the_scene_of_the_start_may_be_loaded_again(peer, tmp_path):
    """The code of the scene that the node was started with has run: it needs no further trust."""
    owned, file = tmp_path / 'owned', tmp_path / 'lift.py'
    file.write_text(LIFT.format(owned=str(owned)))
    scene = tmp_path / 'scene.yaml'
    scene.write_text('mechanism: slider_crank\neffects: {lift.py: {strength: 1}}\n')
    with SimulatorProcess(tmp_path / 'node', '--no-record', scene=scene).wait_running() as node:
        assert owned.exists()
        assert (answer := loaded(peer, scene)).successful, answer.reason
        file.write_text(file.read_text() + '# another text\n')
        answer = loaded(peer, scene)
        assert not answer.successful and 'code would run' in answer.reason
        assert node.stop() == 0, node.output
