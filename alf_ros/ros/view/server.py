"""The page of the live view, served on this machine only, with Python's own library.

A browser gets the page and its script, then the pictures as server-sent events, and posts
commands. A command is taken only from the page itself: other open pages of the browser can neither
read its data nor command.
"""

from __future__ import annotations

import io
import json
import math
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from alf_ros.errors import AlfError, InputError
from alf_ros.logs.report.html import PAGE as SHARED  # so that both look alike
from alf_ros.logs.report.solid_bodies import three_js

HOST = '127.0.0.1'
SCRIPT = 'text/javascript; charset=utf-8'
PAGE = Path(__file__).with_name('page')
FILES = {
    '/': (PAGE / 'index.html', 'text/html; charset=utf-8'),
    '/look.css': (SHARED / 'look.css', 'text/css; charset=utf-8'),
    '/stage.js': (SHARED / 'stage.js', SCRIPT),
    '/solids.js': (SHARED / 'solids.js', SCRIPT),
    '/view.js': (PAGE / 'view.js', SCRIPT),
}
POLICY = (
    "default-src 'self'; img-src data:; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'"
)
# Everything that somebody on this machine may send or hold open has an end: bytes of a command and
# of a request before it, connections at a time, and of these readers of pictures; seconds until a
# request is whole, and without a byte being taken or given.
LARGEST_COMMAND, LARGEST_HEAD = 1 << 16, 1 << 14
MOST_CONNECTIONS, MOST_READERS = 64, 32
REQUEST_TIME, IDLE_TIME = 10.0, 5.0
# A reader who has gone is noticed when something is sent to him: at least this often (s).
HEARTBEAT = 1.0


class Broadcast:
    """The newest picture, for any number of readers: a slow reader misses some."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._about = self._picture = ''
        self._versions = [0, 0]
        self.readers = 0

    @property
    def wanted(self) -> bool:
        """Whether anybody reads."""
        return self.readers > 0

    def put(self, about: dict[str, Any], picture: dict[str, Any] | None) -> None:
        """The present data; a picture of None means that the last one is unchanged."""
        text = json.dumps(about)
        if text == self._about and picture is None:
            return
        with self._changed:
            if text != self._about:
                self._about = text
                self._versions[0] += 1
            if picture is not None:
                self._picture = json.dumps(picture)
                self._versions[1] += 1
            self._changed.notify_all()

    def read(self) -> Iterator[str]:
        """Events for one reader, without end; at every heartbeat at least an empty one."""
        seen = [-1, -1]
        with self._reading():
            while True:
                with self._changed:
                    if self._versions == seen:
                        self._changed.wait(HEARTBEAT)
                    parts = (('about', self._about), ('picture', self._picture))
                    pairs = zip(parts, self._versions, seen, strict=True)
                    events = [part for part, version, before in pairs if version != before]
                    seen = list(self._versions)
                yield (
                    ''.join(f'event: {e}\ndata: {data}\n\n' for e, data in events if data)
                    or ':\n\n'
                )

    @contextmanager
    def _reading(self) -> Iterator[None]:
        with self._changed:
            self.readers += 1
        try:
            yield
        finally:
            with self._changed:
                self.readers -= 1


class Server(ThreadingHTTPServer):
    """Serves `broadcast` at `url` while entered; commands go to `obey`, whose AlfErrors are
    answered. `mesh` gives the JSON of a mesh by its name, None if there is none.

    Raises InputError if the port is taken.
    """

    daemon_threads = True
    request_queue_size = MOST_CONNECTIONS

    def __init__(
        self,
        port: int,
        broadcast: Broadcast,
        obey: Callable[[object], str],
        mesh: Callable[[str], bytes | None],
    ) -> None:
        self.broadcast, self.obey, self.mesh = broadcast, obey, mesh
        self._open: dict[Any, float] = {}  # sockets, and when their request must be whole (s)
        self._lock = threading.Lock()
        try:
            super().__init__((HOST, port), _Request)
        except OSError as error:
            raise InputError(
                f'cannot be opened: {error.strerror}',
                key='--port',
                value=port,
                expected='a free one',
            ) from None
        self.url = f'http://localhost:{self.server_port}/'
        threading.Thread(target=self.serve_forever, name='page', daemon=True).start()

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer in a thread, if there are not too many."""
        with self._lock:
            free = len(self._open) < MOST_CONNECTIONS
            if free:
                self._open[request] = time.monotonic() + REQUEST_TIME
        if free:
            super().process_request(request, client_address)
        else:
            request.settimeout(0.0)
            with suppress(OSError):
                request.send(_FULL)
            self.shutdown_request(request)

    def whole(self, request: Any) -> None:
        """A request has come: from here on only the limit of its socket holds."""
        with self._lock:
            self._open[request] = math.inf

    def service_actions(self) -> None:
        """Twice a second: end what sends its request a byte at a time."""
        now = time.monotonic()
        with self._lock:
            for request, end in self._open.items():
                if end < now:
                    with suppress(OSError):
                        request.shutdown(socket.SHUT_RDWR)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Connections that end in the middle are of no use to anybody; the rest is a mistake."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


_FULL = b'HTTP/1.0 503 Too many connections\r\nContent-Length: 0\r\n\r\n'


class _Head(io.BufferedReader):
    """The input of a connection, with a common limit for the lines before the body."""

    left = LARGEST_HEAD

    def readline(self, size: int | None = -1) -> bytes:
        """A line, or an empty one where there have been too many: the request ends there."""
        limit = max(self.left, 0) + 1
        line = super().readline(min(size, limit) if size and size > 0 else limit)
        self.left -= len(line)
        return line if self.left >= 0 else b''


class _Request(BaseHTTPRequestHandler):
    server: Server
    timeout = IDLE_TIME

    def setup(self) -> None:
        """Read through `_Head`."""
        super().setup()
        self.rfile.close()
        self.rfile = _Head(socket.SocketIO(self.connection, 'r'))

    def parse_request(self) -> bool:
        """Whether the head of a request can be understood."""
        understood = super().parse_request()
        if understood and self.rfile.left < 0:  # type: ignore[attr-defined]
            self.send_error(431)
            return False
        return understood

    def version_string(self) -> str:
        """Which Python serves is nobody's business."""
        return 'alf_ros'

    def do_GET(self) -> None:
        if not self._is_ours():
            return
        self.server.whole(self.connection)
        if self.path == '/events':
            self._stream()
        elif self.path in FILES:
            path, kind = FILES[self.path]
            self._answer(200, path.read_bytes(), kind)
        elif self.path == '/three.js' and three_js():
            self._answer(200, three_js().encode(), SCRIPT)
        elif body := self._mesh():
            self._answer(200, body, 'application/json')
        else:
            self.send_error(404)

    def _mesh(self) -> bytes | None:
        before, _, name = self.path.rpartition('/')
        return self.server.mesh(name) if before == '/mesh' else None

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        length = self.headers.get('Content-Length', '')
        # Another page cannot send this type without asking first, and is not answered.
        if self.path != '/command' or self.headers.get_content_type() != 'application/json':
            self.send_error(404)
        elif not length.isdecimal() or int(length) > LARGEST_COMMAND:
            self.send_error(413)
        else:
            body = self.rfile.read(int(length))
            self.server.whole(self.connection)
            self._obey(body)

    def _is_ours(self) -> bool:
        """Whether it was asked for by the name of this machine, and not by another page."""
        hosts = {f'{name}:{self.server.server_port}' for name in (HOST, 'localhost')}
        origin = self.headers.get('Origin')
        ours = self.headers.get('Host') in hosts
        ours = ours and (origin is None or origin.removeprefix('http://') in hosts)
        if not ours:
            self.send_error(403)
        return ours

    def _obey(self, body: bytes) -> None:
        try:
            said, done = self.server.obey(json.loads(body)), True
        except (AlfError, ValueError, RecursionError) as error:
            said, done = str(error), False
        answer = json.dumps({'done': done, 'said': said})
        self._answer(200, answer.encode(), 'application/json')

    def _stream(self) -> None:
        if self.server.broadcast.readers >= MOST_READERS:
            self.send_error(503)
            return
        self._head(200, 'text/event-stream')
        self.end_headers()
        events = self.server.broadcast.read()
        try:
            for text in events:
                self.wfile.write(text.encode())
        except OSError:
            pass  # the page was closed
        finally:
            events.close()  # type: ignore[attr-defined]

    def _answer(self, code: int, body: bytes, kind: str) -> None:
        self._head(code, kind)
        self.send_header('Content-Length', str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _head(self, code: int, kind: str) -> None:
        self.send_response(code)
        self.send_header('Content-Type', kind)
        self.send_header('Cache-Control', 'no-store')
        self.send_header('Content-Security-Policy', POLICY)
        self.send_header('X-Content-Type-Options', 'nosniff')

    def log_message(self, *_: object) -> None:
        """A line for every request is of no use to anybody."""
