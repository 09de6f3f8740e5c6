"""The process of one component, as the master's process sees it: start, ask, end.

What the FMU prints does not get out of it, but for the last lines, as notes of the error when the
process is lost.
"""

import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections import deque
from contextlib import ExitStack
from multiprocessing.connection import Connection
from typing import Any

from ..errors import InputError, SimulationError
from .exchange import ANSWER, CALL, LOGGED, SIZE, Exchange

TIMEOUT = 30.0
"""s of wall time that a call to an FMU may take in the run; then its process is ended."""

START_TIMEOUT = 120.0
"""s of wall time that loading or initialising it may take."""

END_TIMEOUT = 10.0
"""s of wall time that ending it may take."""

LINES = 40
"""The last lines of what an FMU printed that are kept for the error."""


class Child:
    """A process that runs worker.py. It ends with this one, however this one ends."""

    def __init__(self, name: str, fmu: str) -> None:
        """Start it; the names of the component and of the FMU's file are for messages."""
        self._name, self._fmu = name, fmu
        self._stack = ExitStack()
        self._lost: SimulationError | None = None
        self._printed: deque[str] = deque(maxlen=LINES)
        folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="grasp_process_"))
        memory = self._stack.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        memory.truncate(SIZE)
        self.exchange = Exchange(memory.fileno())
        ours, theirs = socket.socketpair()
        self._connection = Connection(ours.detach())
        reading, writing = os.pipe()
        self._stack.callback(os.close, writing)
        ends = (theirs.fileno(), memory.fileno(), reading)
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-m", "grasp_cosim.fmi.worker", *map(str, ends)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=ends,
            start_new_session=True,  # Ctrl-C is for the master alone
            env={**os.environ, "PYTHONPATH": path, "TMPDIR": folder},
            text=True,
            errors="replace",
        )
        theirs.close()
        os.close(reading)
        self._poll = select.poll()
        self._poll.register(self._connection.fileno(), select.POLLIN)
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()

    def _read_output(self) -> None:
        if self._process.stdout is not None:
            with self._process.stdout as output:
                self._printed.extend(output)

    def exchange_values(self, command: bytes) -> int:
        """STEP or FETCH; the FMI status.

        SimulationError where the FMU fails before or after the step, or the process is lost.
        """
        status: int = self._request(command, None, TIMEOUT)
        return status

    def ask(self, method: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
        """Return the value of a worker's method; InputError or SimulationError if it raises one."""
        return self._request(CALL, (method, arguments), timeout)

    def start(self, method: str, *arguments: Any) -> None:
        """Ask while the FMU is loaded or initialised: InputError also where its process is lost."""
        try:
            self.ask(method, *arguments, timeout=START_TIMEOUT)
        except SimulationError as error:
            raise InputError(str(error)) from error

    def close(self) -> None:
        """Close the instance and end the process."""
        try:
            if self._lost is None:
                self.ask("close", timeout=END_TIMEOUT)
        except SimulationError as error:
            warnings.warn(f"{error}, while it was closed", stacklevel=2)
        finally:
            self.end()

    def end(self) -> None:
        """End the process, by force where it does not end in time."""
        self._connection.close()
        self._wait_for_the_end()
        self._stack.close()

    def _request(self, command: bytes, call: Any, timeout: float) -> Any:
        """Send a command and wait for the answer: a status, or what a method returns."""
        if self._lost is not None:
            raise self._lost
        try:
            self._connection.send_bytes(command)
            if call is not None:
                self._connection.send(call)
            if not self._poll.poll(1000.0 * timeout):
                self._process.kill()
                raise self._lose(f"did not answer within {timeout:g} s and was ended")
            status = self._connection.recv_bytes()[0]
            if status < ANSWER:
                return status
            kind, value, notes = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._lose() from error
        except KeyboardInterrupt:  # an answer on the way would be taken for the next one
            self._process.kill()
            self._lose("was interrupted and ended")
            raise
        return self._value(kind, value, notes)

    def _lose(self, what: str = "") -> SimulationError:
        """The error for a process that has ended, or is about to."""
        self._wait_for_the_end()
        code = self._process.returncode
        ended = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        logged = [line.removeprefix(LOGGED) for line in self._printed if line.startswith(LOGGED)]
        said = f": {' '.join(logged[-1].split())}" if logged else ""
        self._lost = SimulationError(
            f"{self._name}: the process of {self._fmu} {what or f'ended with {ended}'} "
            f"at t = {self.exchange.clock[0]:.9g} s{said}"
        )
        for line in self._printed:
            self._lost.add_note(line.rstrip())
        return self._lost

    def _wait_for_the_end(self) -> None:
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(END_TIMEOUT)

    def _value(self, kind: str, value: Any, notes: list[str]) -> Any:
        """The value of an answer, or the error that it is."""
        if kind == "value":
            for text in notes:
                warnings.warn(text, stacklevel=3)
            return value
        error = (InputError if kind == "InputError" else SimulationError)(value)
        for text in notes:
            error.add_note(text)
        raise error
