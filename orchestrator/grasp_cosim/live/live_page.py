"""A run and its page: what the page shows, and what it asks of the run."""

from __future__ import annotations

import base64
import json
import struct
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from types import TracebackType
from typing import Any, Self

from ..base.errors import RunInterruptedError
from ..interface.values import Given
from ..master.requests import Answer, Requests
from ..report.traces_page import Scene
from ..system.description import System
from .feed import Feed
from .page import page_html
from .panel import settings_of
from .result_so_far import links_so_far, result_so_far, scene_so_far
from .server import LiveServer

FRAME = 1.0 / 30.0
"""s of wall time between two frames of a client, at least."""

OFTEN, SELDOM = 0.5, 1.0
"""s between two looks at the links, and at the scene."""

MAX_FRAME_PAIRS = 1024
"""In a frame; who is further behind loads the history again."""

MAX_LINES = 500
"""Of the log, the last ones, are shown."""

START_WITHIN = 60.0
"""s that a page waits for the first row: FMUs may load for long."""

HEARTBEAT = 1.0
"""s after which a client gets a frame although there is nothing new."""


class LivePage:
    """A page on loopback that follows one run, and sets values in it.

    It is a context manager around that run:

        with LivePage(system) as live:
            print(live.address)
            simulate(
                live.system, realtime=True, listeners=[live.feed], requests=live.requests
            )

    Leaving it ends the page: its last state stays on the screen.
    """

    def __init__(self, system: System, every: int = 1, port: int = 0) -> None:
        """Make a page, which is served from the beginning of its context to the end.

        Args:
            system: The system that runs.
            every: Every how many steps are recorded.
            port: The port on loopback; 0 takes any that is free. Entering the context raises an
                InputError where it is taken.
        """
        self.system = system.as_steered()
        """The system to run, which records all that may be set."""
        self.requests = Requests(self.system)
        """What the page asks for; for simulate()."""
        self.feed = Feed(system.realtime.factor, every)
        """The listener to give to simulate()."""
        self.settings = settings_of(self.system)
        self._of = {entry["name"]: entry for entry in self.settings}
        self._lines: list[str] = []
        self._line_count = 0
        self._links: Mapping[str, Any] = {}
        self._scene: Scene | None = None
        self._scene_version = 0
        self._has_scene: bool | None = None
        self._state, self._reason = "starting", ""
        self._over = threading.Event()
        self._port = port
        self._pump = threading.Thread(target=self._keep_up, name="live feed")

    def __enter__(self) -> Self:
        self._server = LiveServer(self, self._port)
        self._server.start()
        self._pump.start()
        return self

    def __exit__(
        self,
        _: type[BaseException] | None,
        error: BaseException | None,
        __: TracebackType | None,
    ) -> None:
        """Tell the clients how the run ended, and end all threads."""
        self.requests.close()
        self._over.set()
        self._pump.join()
        if isinstance(error, RunInterruptedError | KeyboardInterrupt):
            self._end("interrupted", "")
        elif error is not None:
            self._end("failed", " ".join(str(error).split()))
        else:
            self._end("ended", "")
        self._server.close()

    @property
    def address(self) -> str:
        """The address of the page."""
        return self._server.address

    def note(self, line: str) -> None:
        """Show a line of the log, once."""
        with self.feed.changed:
            if line not in self._lines:
                self._lines = [*self._lines, line][-MAX_LINES:]
                self._line_count += 1

    def _end(self, state: str, reason: str) -> None:
        if self.feed.has_rows:
            self._look(links=True, scene=True)
        with self.feed.changed:
            self._state, self._reason = state, reason
            self.feed.ended = True
            self.feed.begun.set()
            self.feed.changed.notify_all()

    def _keep_up(self) -> None:
        """Pair the rows that come, and look at what follows of them from time to time."""
        beats = 0
        while not self._over.wait(FRAME):
            self.feed.digest()
            beats += 1
            if not self.feed.has_rows:
                continue
            often, seldom = (beats % round(period / FRAME) == 0 for period in (OFTEN, SELDOM))
            if self._has_scene is None or often or seldom:
                self._look(links=often, scene=seldom or self._has_scene is None)

    def _look(self, links: bool, scene: bool) -> None:
        """Work out the figures of the links, and what the scene knows."""
        if links:
            self._links = links_so_far(self.feed)
            for line in self.requests.happened():
                self.note(line)
        if scene and self._has_scene is not False:
            new = scene_so_far(self.system, self.feed)
            self._has_scene = new is not None
            if new is not None:
                old, self._scene = self._scene, new
                if old is None or (old.state, old.marks) != (new.state, new.marks):
                    self._scene_version += 1
        if self._state == "starting":
            self._state = "running"

    # What the server asks for.

    def page(self) -> str:
        """The page; one that says so where the run has not begun."""
        if not (self.feed.begun.wait(START_WITHIN) and self.feed.has_rows):
            return "<!DOCTYPE html><title>live</title><p>The run has not begun.</p>"
        if self._has_scene is None:
            self._look(links=True, scene=True)
        result = result_so_far(self.system, self.feed)
        return page_html(result, self._scene, self.settings, self.feed.left_out)

    def history(self) -> bytes:
        """The rows so far: the number of the next pair and the columns, then the rows, doubles."""
        with self.feed.changed:
            rows, count = self.feed.pairs.all(), self.feed.pairs.count
        return struct.pack("<2d", count, rows.shape[1]) + rows.astype("<f8").tobytes()

    def frames(self, goes_on: Callable[[], bool]) -> Iterator[str]:
        """What a client gets: see Source. At most 30 frames a second, and the newest."""
        if not (self.feed.begun.wait(START_WITHIN) and self.feed.has_rows):
            return
        number, lines, scene, is_last = self.feed.pairs.count, 0, 0, False
        while not is_last and goes_on():
            with self.feed.changed:
                if not self.feed.ended and self.feed.pairs.count == number:
                    self.feed.changed.wait(HEARTBEAT)
                is_last = self._state in ("ended", "failed", "interrupted")
                piece = self.feed.pairs.since(number, MAX_FRAME_PAIRS)
                number = piece.first + len(piece.rows)
                is_last = is_last and number == self.feed.pairs.count
                frame = self._status()
                frame |= {
                    "first": piece.first,
                    "rows": base64.b64encode(piece.rows.astype("<f8").tobytes()).decode(),
                    "line": max(lines, self._line_count - len(self._lines)),
                    "lines": self._lines[max(0, lines - self._line_count + len(self._lines)) :],
                    "last": is_last,
                }
                lines = self._line_count
                if scene != self._scene_version and self._scene is not None:
                    scene = self._scene_version
                    frame["scene"] = {"state": self._scene.state, "marks": self._scene.marks}
            yield json.dumps(frame)
            if not is_last:
                time.sleep(FRAME)

    def _status(self) -> dict[str, Any]:
        """How the run goes, for a frame."""
        status: dict[str, Any] = {
            "state": self._state,
            "reason": self._reason,
            "time": self.feed.time,
            "links": self._links,
            "values": {entry["name"]: entry["value"] for entry in self._changed()},
        }
        if self.requests.meter is not None:
            status |= self.requests.meter.so_far()._asdict()
        return status

    def _changed(self) -> list[dict[str, Any]]:
        """What can be set and was."""
        return [entry for entry in self.settings if entry.get("is_set")]

    def set(self, name: str, value: Given, within: float) -> Answer:
        """Set a variable, and note what it has then."""
        answer = self.requests.ask(name, value).result(within)
        with self.feed.changed:
            if name in self._of:  # which has no second names of a variable
                self._of[name] |= {"value": answer.value, "is_set": True}
        self.note(answer.line)
        return answer
