"""A page in headless Chromium, which is told what to do through two pipes of its DevTools.

Unlike --screenshot and --dump-dom this works for a page that goes on loading, as a live page does.
"""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import signal
import time
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

FREE = 10
"""From this number on descriptors of files are not those that Chromium takes for its pipes."""

TRIES, PAUSE = 1200, 0.05
"""So often at most it is looked whether something has become true; s between two looks."""


def chromium() -> str | None:
    """Return the path of Chromium; None where it is not installed."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Browser:
    """A window of Chromium with one page; a context manager."""

    def __init__(self, width: int, height: int, dark: bool = False) -> None:
        """A window of so many CSS pixels. FileNotFoundError where Chromium is not installed."""
        self._size, self._dark = (width, height), dark
        self._numbers = itertools.count(1)
        self.errors: list[str] = []
        """The errors of scripts in the page."""

    def __enter__(self) -> Self:
        program = chromium()
        if program is None:
            raise FileNotFoundError("chromium is not installed")
        with ExitStack() as stack:
            profile = stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True))
            asked, ask = os.pipe()
            answer, answered = os.pipe()
            self._requests = stack.enter_context(os.fdopen(ask, "wb", buffering=0))
            self._answers = stack.enter_context(os.fdopen(answer, "rb"))
            arguments = [
                program, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                "--disable-background-networking", f"--user-data-dir={profile}",
                "--remote-debugging-pipe", "about:blank",
            ]  # fmt: skip
            try:
                process = _spawned(arguments, asked, answered)
            finally:
                os.close(asked)
                os.close(answered)
            stack.callback(os.waitpid, process, 0)
            stack.callback(os.kill, process, signal.SIGTERM)
            self._attach()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        """End Chromium."""
        self._stack.close()

    def _attach(self) -> None:
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self._call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Runtime", "Page"):
            self._call(f"{domain}.enable")
        width, height = self._size
        self._call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if self._dark else "light"}
        self._call("Emulation.setEmulatedMedia", features=[scheme])

    _session = ""

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a method of the DevTools; RuntimeError where it fails."""
        number = next(self._numbers)
        request = {"id": number, "method": method, "params": parameters}
        if self._session:
            request["sessionId"] = self._session
        self._requests.write(json.dumps(request).encode() + b"\0")
        while True:
            message = self._message()
            if message.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(message["params"]["exceptionDetails"]))
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                result: dict[str, Any] = message["result"]
                return result

    def _message(self) -> dict[str, Any]:
        text = bytearray()
        while (byte := self._answers.read(1)) != b"\0":
            if not byte:
                raise RuntimeError("chromium has ended")
            text += byte
        message: dict[str, Any] = json.loads(text)
        return message

    def open(self, url: str) -> None:
        """Go to a page."""
        self._call("Page.navigate", url=url)

    def evaluate(self, script: str) -> Any:
        """Return the value of a script, awaited; RuntimeError where it throws."""
        done = self._call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in done:
            raise RuntimeError(json.dumps(done["exceptionDetails"]))
        return done["result"].get("value")

    def wait_for(self, script: str) -> Any:
        """Return the value of a script once that is true; RuntimeError where it does not become."""
        for _ in range(TRIES):
            if value := self.evaluate(f"(() => {{ try {{ return {script} }} catch {{}} }})()"):
                return value
            time.sleep(PAUSE)
        raise RuntimeError(f"did not become true: {script}")

    def screenshot(self, path: Path) -> None:
        """Write what is seen of the page, as PNG."""
        data = self._call("Page.captureScreenshot", format="png")["data"]
        path.write_bytes(base64.b64decode(data))


def _spawned(arguments: list[str], reads: int, writes: int) -> int:
    """The number of the process of a program, which reads descriptor 3 and writes descriptor 4."""
    fcntl: Any = import_module("fcntl")  # of POSIX, as the function below
    posix: Any = os
    high = [fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, FREE) for end in (reads, writes)]
    try:
        return int(posix.posix_spawn(
            arguments[0], arguments, os.environ,
            file_actions=[
                *((posix.POSIX_SPAWN_OPEN, number, os.devnull, os.O_RDWR, 0) for number in (1, 2)),
                *((posix.POSIX_SPAWN_DUP2, end, number) for number, end in enumerate(high, 3)),
            ],
        ))  # fmt: skip
    finally:
        for end in high:
            os.close(end)
