"""Meshes in the live view: of files that the scene names, and by names that are no paths."""

from __future__ import annotations

import http.client
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from alf_ros import load_scene
from alf_ros.mechanism import VisualShape
from alf_ros.ros.messages.shape_markers import shape_marker
from alf_ros.ros.messages.topics import LATCHED
from alf_ros.ros.view.mesh_library import MeshLibrary
from alf_ros.ros.view.server import POLICY, Broadcast, Server
from alf_ros.ros.view.view_node import ViewNode
from support.meshes import WEDGE, binary_stl
from support.ros_node import LIMIT, Peer

SCENE: dict[str, Any] = {
    'mechanism': {
        'alf': 1,
        'space': 'planar',
        'points': {'O': {'at': [0, 0], 'fixed': True}, 'A': {'at': [1, 0]}},
        'bodies': {'bar': {'points': ['O', 'A'], 'mass': 1, 'inertia': 'rod'}},
        'joints': {'hinge': {'type': 'revolute', 'between': ['ground', 'bar'], 'at': 'O'}},
    },
    'effects': {'gravity': {'acceleration': [0, -9.81]}},
}


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """A mesh that the scene names, and one that it does not."""
    named, other = tmp_path / 'named.stl', tmp_path / 'other.stl'
    for file in (named, other):
        file.write_bytes(binary_stl(WEDGE))
    return str(named), str(other)


@pytest.fixture
def node(peer: Peer) -> Iterator[tuple[ViewNode, MeshLibrary]]:
    library = MeshLibrary()
    made = ViewNode('stranger', library)
    yield made, library
    made.destroy_node()


def marker(file: str, number: int) -> Marker:
    made = shape_marker(VisualShape('mesh', (2.0, 1.0, 1.0), file=file), number, 0.0)
    made.pose.orientation.w = 1.0
    return made


def get(server: Server, path: str) -> tuple[int, bytes, str | None]:
    connection = http.client.HTTPConnection('127.0.0.1', server.server_port, timeout=60.0)
    connection.request('GET', path)
    answer = connection.getresponse()
    found = answer.status, answer.read(), answer.getheader('Content-Security-Policy')
    connection.close()
    return found


def test_only_meshes_that_the_scene_names_are_drawn(
    node: tuple[ViewNode, MeshLibrary], peer: Peer, files: tuple[str, str]
) -> None:
    view, library = node
    view.follow(True)
    shapes = [{'mesh': {'file': files[0]}}]
    scene = {**SCENE, 'mechanism': {**SCENE['mechanism'], 'shapes': shapes}}
    said = peer.node.create_publisher(String, 'stranger/scene', LATCHED)
    said.publish(String(data=load_scene(scene).text))
    drawn = peer.talk('stranger/markers', MarkerArray)

    def picture() -> dict[str, Any] | None:
        drawn.publish(MarkerArray(markers=[marker(file, n) for n, file in enumerate(files)]))
        view.look()
        return view.picture if (view.picture or {}).get('shapes') else None

    found = peer.until(picture, 'the mesh')
    (shape,) = found['shapes']
    assert found['missing'] == 1  # the other
    assert found['shape_points'] == [1, 0.5, 0.25, 2, 0.5, 0.25, 1, 1, 0.25, 1, 0.5, 0.5]
    assert shape['kind'] == 'mesh' and shape['color'] is None
    text = library.text(shape['mesh'])
    assert text is not None and b'stl' not in text
    assert sorted(json.loads(text)) == ['colors', 'edges', 'extremes', 'faces', 'vertices']
    view.follow(False)


def test_no_file_is_served_by_its_path(files: tuple[str, str], peer: Peer) -> None:
    library = MeshLibrary()
    name, _ = peer.until(lambda: library.find(files[0]), 'a mesh')
    with Server(0, Broadcast(), str, library.text) as server:
        status, body, policy = get(server, f'/mesh/{name}')
        assert status == 200 and body == library.text(name) and policy == POLICY
        for path in (
            *('/mesh/', '/mesh', f'/mesh/{files[0]}', f'/mesh/../mesh/{name}', f'/{name}'),
            *(f'/mesh/{files[0].replace("/", "%2F")}', '/mesh/../../etc/passwd', '/meshes/x'),
        ):
            assert get(server, path)[0] == 404


def test_why_a_mesh_is_not_drawn_is_said_once(tmp_path: Path) -> None:
    """The page counted it, and nothing said why."""
    large, second, empty = (tmp_path / f'{name}.stl' for name in ('large', 'second', 'empty'))
    for file in (large, second):
        with open(file, 'wb') as stream:
            stream.truncate(200_000_000)
    empty.write_bytes(binary_stl(WEDGE[:0]))
    said = list[str]()
    heard = threading.Event()

    def hear(text: str) -> None:
        said.append(text)
        if 'empty' in text:
            heard.set()

    library = MeshLibrary(hear)
    for file in (large, second, empty):
        assert library.find(str(file)) is None
    assert heard.wait(LIMIT)
    assert said[0] == 'a mesh is not drawn: large.stl: more than 64 MB'
    assert len(said) == 2 and said[1].startswith('a mesh is not drawn: empty.stl: ')
