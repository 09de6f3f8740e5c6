"""What other threads ask of a run: to set a variable at the next communication point.

The thread of the run takes the requests between two steps, in both engines, and does them as an
event of that time does: see Scenario.request(). So a system with these events repeats the run.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import NamedTuple

from ..base.errors import InputError
from ..interface.fmi_types import Value
from ..interface.values import Given
from ..realtime.timing import Meter
from ..system.description import System
from ..system.names import main_port
from ..system.parts import Port, as_port
from ..system.scenario import parse_set_values

MAX_WAITING = 64
"""So many requests may wait at a time; a run that takes none refuses more."""


class Answer(NamedTuple):
    """What became of a request: when it was done, in s, what its FMU has now, and the log line."""

    time: float
    value: Value
    line: str


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """A value for a variable, and who waits for the answer."""

    port: Port
    value: Given
    answer: Future[Answer] = field(default_factory=Future)


class Requests:
    """A queue from any thread to the thread of one run.

    It is given to simulate() or to a session. Leaving the run closes it.

    Example:
        >>> from grasp_cosim import grasp_system, simulate
        >>> from grasp_cosim.master.requests import Requests
        >>> system = grasp_system()
        >>> requests = Requests(system)
        >>> answer = requests.ask("sensor_2.reflectance", 0.6)
        >>> result = simulate(system, step=1e-3, stop=0.1, requests=requests)
        >>> answer.result().line, result.settings["events"]
        ('t = 0 s: sensor_2.reflectance = 0.6', [{'at': 0.0, 'set': {'sensor_2.reflectance': 0.6}}])
    """

    def __init__(self, system: System) -> None:
        """Take requests for a system, which need not run yet."""
        self._system = system
        self._interfaces = {c.name: c.interface for c in system.components}
        self._waiting: deque[Request] = deque()
        self._open: set[Request] = set()
        self._lock = threading.Lock()
        self._closed = False
        self.happened: Callable[[], Sequence[str]] = tuple
        """The lines of the log on what has happened in the run so far; for any thread."""
        self.meter: Meter | None = None
        """The timing of the run, once it goes on in real time."""

    def ask(self, name: str, value: Given) -> Future[Answer]:
        """Have a variable set at the next communication point at which its component steps.

        Args:
            name: A tunable parameter or an input without a source, like "sensor_2.reflectance"; of
                an array one element.
            value: The value in the unit of the variable, or one with its unit, as "50 mm".

        Returns:
            The answer, once it is there. Its exception is an InputError where the FMU refuses the
            value and keeps the older one, or the run ended before.

        Raises:
            InputError: There is no such variable that may be set now, the value does not fit it, or
                too many requests wait.
        """
        place = f"set: {name}"
        port = main_port(self._interfaces, as_port(place, name))
        values = parse_set_values(self._system, port, value, place)
        if [*values] != [port]:
            raise InputError(f"{place}: is an array; must be one of its elements")
        request = Request(port, value)
        with self._lock:
            if self._closed:
                raise InputError(f"{place}: the run has ended; must be asked while it goes on")
            if len(self._waiting) >= MAX_WAITING:
                raise InputError(f"{place}: {MAX_WAITING} requests wait; must be asked later")
            self._waiting.append(request)
            self._open.add(request)
        return request.answer

    @property
    def are_waiting(self) -> bool:
        """True if there is something to take."""
        return bool(self._waiting)

    def take(self) -> Sequence[Request]:
        """Those that wait, in their order; for the thread of the run only."""
        with self._lock:
            taken = [*self._waiting]
            self._waiting.clear()
        return taken

    def settle(self, request: Request, answer: Answer | Exception) -> None:
        """Answer a request that was taken."""
        with self._lock:
            self._open.discard(request)
        if isinstance(answer, Exception):
            request.answer.set_exception(answer)
        else:
            request.answer.set_result(answer)

    def close(self) -> None:
        """Refuse what was not done, and whatever comes: the run has ended."""
        with self._lock:
            self._closed = True
            left, self._open = self._open, set()
            self._waiting.clear()
        for request in left:
            ended = InputError(f"set: {request.port}: the run ended before")
            request.answer.set_exception(ended)
