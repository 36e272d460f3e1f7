"""The view at work: a node that follows the simulator, and the servers that show what it hears."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack

from alf_ros.ros.view.foxglove import FoxgloveBridge
from alf_ros.ros.view.mesh_library import MeshLibrary
from alf_ros.ros.view.operator import Operator
from alf_ros.ros.view.server import Broadcast, Server
from alf_ros.ros.view.view_node import ViewNode

# Pictures a second (Hz): as many as the simulator draws if nobody says otherwise.
RATE = 30.0


def serve(
    simulator: str,
    port: int,
    foxglove: int | None,
    stop: threading.Event,
    say: Callable[[str], None],
) -> None:
    """Show the node `simulator` at `port` (0: any), and to Foxglove if given a port, until `stop`.

    rclpy must be initialised. `say` is called with where each can be opened, and with why a mesh
    is not drawn. Raises InputError if a port is taken or foxglove-sdk is not there.
    """
    meshes = MeshLibrary(say)
    node = ViewNode(simulator, meshes)
    operator = Operator(node, simulator)
    broadcast = Broadcast()
    with ExitStack() as serving:
        server = serving.enter_context(Server(port, broadcast, operator.obey, meshes.text))
        say(server.url)
        if foxglove is not None:
            bridge = serving.enter_context(_bridge(simulator, foxglove))
            say(f'Foxglove at {bridge.url}')
        while not stop.wait(1.0 / RATE):
            node.follow(broadcast.wanted)
            node.look()
            operator.work()
            broadcast.put(node.about, node.picture)


def _bridge(simulator: str, port: int) -> FoxgloveBridge:
    # Imported here: the page alone works without it.
    return FoxgloveBridge(simulator, port)
