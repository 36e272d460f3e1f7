"""A headless Chromium, driven through a pipe by its DevTools protocol with Python's library."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

CHROMIUM = next(
    filter(None, map(shutil.which, ('chromium', 'chromium-browser', 'google-chrome'))), None
)
LIMIT = 60.0


class Browser:
    """One page at `url`, in a window of `size`, with a profile of its own below `folder`; without
    WebGL if it shall be `flat`."""

    def __init__(
        self, url: str, folder: Path, size: tuple[int, int] = (1280, 800), *, flat: bool = False
    ) -> None:
        assert CHROMIUM is not None
        ours, theirs = os.pipe(), os.pipe()  # they read from 3, write to 4
        self._out, self._in = ours[1], theirs[0]

        def connect() -> None:
            # What is at 3 or 4 by chance must not be closed before it is copied.
            read, write = os.dup(ours[0]), os.dup(theirs[1])
            os.dup2(read, 3)
            os.dup2(write, 4)

        self.process = subprocess.Popen(
            [
                CHROMIUM,
                '--headless=new',
                '--no-sandbox',
                '--disable-gpu',
                '--enable-unsafe-swiftshader',  # WebGL without a graphics card
                *(['--disable-3d-apis'] if flat else []),
                '--disable-dev-shm-usage',
                '--no-first-run',
                '--disable-background-networking',
                '--remote-debugging-pipe',
                f'--user-data-dir={folder}',
                f'--window-size={size[0]},{size[1]}',
                'about:blank',
            ],
            preexec_fn=connect,
            close_fds=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(ours[0])
        os.close(theirs[1])
        self._rest, self._count = b'', 0
        self.complaints: list[Any] = []
        self._url = url
        self._session: str | None = None
        (page,) = (
            target['targetId']
            for target in self._call('Target.getTargets')['targetInfos']
            if target['type'] == 'page'
        )
        attached = self._call('Target.attachToTarget', targetId=page, flatten=True)
        self._session = attached['sessionId']
        for domain in ('Page', 'Runtime', 'Log', 'Network'):
            self._call(f'{domain}.enable')
        width, height = size
        self._call(
            'Emulation.setDeviceMetricsOverride',
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        self._call('Page.navigate', url=url)
        self.until("location.href !== 'about:blank' && document.readyState === 'complete'")

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
            os.close(self._out)
            os.close(self._in)

    def _read(self, end: float) -> Any:
        while b'\0' not in self._rest:
            ready, _, _ = select.select([self._in], [], [], max(0.0, end - time.monotonic()))
            assert ready, 'the browser does not answer'
            part = os.read(self._in, 1 << 16)
            assert part, 'the browser ended'
            self._rest += part
        message, _, self._rest = self._rest.partition(b'\0')
        return json.loads(message)

    def _call(self, method: str, **parameters: Any) -> Any:
        self._count += 1
        message: dict[str, Any] = {'id': self._count, 'method': method, 'params': parameters}
        if self._session:
            message['sessionId'] = self._session
        os.write(self._out, json.dumps(message).encode() + b'\0')
        end = time.monotonic() + LIMIT
        while (answer := self._read(end)).get('id') != self._count:
            self._hear(answer)
        assert 'result' in answer, answer
        return answer['result']

    def _hear(self, event: dict[str, Any]) -> None:
        """Remember errors in the page, and requests that leave this machine.

        The request for the page itself is not counted.
        """
        parameters = event.get('params', {})
        if event.get('method') == 'Runtime.exceptionThrown':
            self.complaints.append(parameters['exceptionDetails'])
        elif event.get('method') == 'Log.entryAdded' and parameters['entry']['level'] == 'error':
            self.complaints.append(parameters['entry'])
        elif event.get('method') == 'Network.requestWillBeSent':
            url = parameters['request']['url']
            if url != self._url and not url.startswith(('http://localhost:', 'data:')):
                self.complaints.append(url)

    def run(self, script: str) -> Any:
        """The value of an expression in the page; promises are awaited."""
        found = self._call(
            'Runtime.evaluate', expression=script, returnByValue=True, awaitPromise=True
        )
        assert 'exceptionDetails' not in found, found
        return found['result'].get('value')

    def until(self, script: str, limit: float = LIMIT) -> Any:
        """Wait until an expression is true in the page; returns its value."""
        end = time.monotonic() + limit
        while not (value := self.run(script)):
            assert time.monotonic() < end, f'not within {limit} s: {script}'
            time.sleep(0.05)
        return value

    def click(self, selector: str, along: float = 0.5) -> None:
        """Press and release the left button on an element, `along` it, as a hand does."""
        self.run(f'document.querySelector({selector!r}).scrollIntoView()')
        x, y = self.run(
            f'(({{x, y, width, height}}) => [x + {along} * width, y + height / 2])'
            f'(document.querySelector({selector!r}).getBoundingClientRect())'
        )
        for kind in ('mousePressed', 'mouseReleased'):
            self._call(
                'Input.dispatchMouseEvent', type=kind, x=x, y=y, button='left', clickCount=1
            )

    def screenshot(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self._call('Page.captureScreenshot')['data']))
