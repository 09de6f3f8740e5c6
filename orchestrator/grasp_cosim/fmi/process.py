"""An instance whose FMU lives in a process of its own: it may crash there, or hang.

What the FMU prints does not get out of it, but for the last lines, as notes of the error when the
process is lost.
"""

import os
import pickle
import socket
import subprocess
import sys
import tempfile
import threading
import warnings
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import InputError, SimulationError, ended
from ..base.scratch import ScratchFolder
from ..base.system_calls import end_group, listener
from ..interface.interface import Interface, Value, Variable
from ..system.parts import Solver
from .instance import EARLY, WARNING, Inputs
from .shared_memory import ANSWER, CALL, FETCH, LOGGED, SIZE, STEP, SharedMemory

POSIX = os.name == "posix"
"""Elsewhere a process is not handed open files."""

TIMEOUT = 30.0
"""s of wall time that a call to an FMU may take in the run; then its process is ended."""

START_TIMEOUT = 120.0
"""s of wall time that loading or initialising it may take."""

END_TIMEOUT = 10.0
"""s of wall time that ending it may take."""

OUTPUT_TIMEOUT = 1.0
"""s of wall time to wait for the last of what it printed, which a daemon of its may keep open."""

LINES = 80
"""The last lines of what an FMU printed that are kept for the error: of a crash both stacks."""


class ProcessInstance:
    """One instance of an FMU in a process of its own, which runs worker.py.

    The process ends with this one, however this one ends.
    """

    def __init__(self, name: str, interface: Interface, solver: Solver | None = None) -> None:
        """Start the process and instantiate; InputError where the FMU does not load."""
        self.name = name
        self.interface = interface
        self._fresh = False
        self._inputs = Inputs()
        if not POSIX:
            raise InputError(
                f"{name}: isolation = 'process' needs Linux or macOS; must be 'none' here"
            )
        self._stack = ExitStack()
        self._lost: SimulationError | None = None
        self._printed: deque[str] = deque(maxlen=LINES)
        folder = self._stack.enter_context(ScratchFolder()).name
        memory = self._stack.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        memory.truncate(SIZE)
        self._exchange = SharedMemory(memory.fileno())
        ours, theirs = socket.socketpair()
        self._connection = Connection(ours.detach())
        reading, writing = os.pipe()
        self._stack.callback(os.close, writing)
        ends = (theirs.fileno(), memory.fileno(), reading)
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-m", "grasp_cosim.fmi.worker", *map(str, ends)],
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
        self._answers = listener(self._connection)
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()
        try:
            self._prepare("load", name, interface, solver)
        except BaseException:
            self._end()
            raise

    def _read_output(self) -> None:
        if self._process.stdout is not None:
            with self._process.stdout as output:
                self._printed.extend(output)

    def close(self) -> None:
        """Terminate and free the FMU as far as it permits, and end its process."""
        try:
            if self._lost is None:
                self._ask("close", timeout=END_TIMEOUT)
        except SimulationError as error:
            warnings.warn(f"{error}, while it was closed", stacklevel=2)
        finally:
            self._end()

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        for name, value in values.items():
            self._inputs.set(self.interface.by_name[name], value)
        self._prepare("enter_initialization", dict(values), stop, start)

    def exit_initialization(self) -> None:
        self._prepare("exit_initialization")
        self._inputs.running = True

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        values: list[Value] = self._ask("get", list(variables))
        return values

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        self._fresh = False
        for variable, value in zip(variables, values, strict=True):
            self._inputs.set(variable, value)
        self._ask("set", list(variables), list(values))

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """As Instance.transfer: inputs arrive with the next step, and outputs come with it."""
        pending, shared = self._exchange.add(self.interface, variables)
        self._ask("transfer", action, list(variables))
        if action == "set":
            self._inputs.bind(variables, data)

        def put() -> int:
            self._fresh = False
            shared[:] = data
            pending[0] = True
            return 0

        def fetch() -> int:
            if not self._fresh:
                self._pass_values(FETCH)
            data[:] = shared
            return 0

        return Call(put if action == "set" else fetch)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        exchange = self._exchange

        def advance() -> int:
            exchange.clock[0] = clock[0]
            exchange.step[0] = step
            return self._pass_values(STEP)

        return Call(advance)

    def last_successful_time(self) -> float | None:
        time: float | None = self._ask("last_successful_time")
        return time

    def the_end(self) -> float | None:
        time: float | None = self._ask("the_end")
        return time

    def failure(self, status: int, time: float) -> SimulationError:
        try:
            return self._ask("failure", status, time)  # type: ignore[no-any-return]
        except SimulationError as error:
            return error

    def _pass_values(self, command: bytes) -> int:
        """STEP or FETCH, one round trip; the FMI status."""
        self._fresh = False
        status: int = self._request(command, None, TIMEOUT)
        self._fresh = status <= WARNING or status == EARLY
        return status

    def _ask(self, method: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
        """Return the value of a worker's method; InputError or SimulationError if it raises one."""
        return self._request(CALL, (method, arguments), timeout)

    def _prepare(self, method: str, *arguments: Any) -> None:
        """Ask while the FMU is loaded or initialised: InputError also where its process is lost."""
        try:
            self._ask(method, *arguments, timeout=START_TIMEOUT)
        except SimulationError as error:
            raise InputError(str(error)) from error

    def _end(self) -> None:
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
                # not send(), whose buffer would be in the traceback of an error, and be complained
                # of when that is cleared away
                self._connection.send_bytes(pickle.dumps(call))
            if not self._answers(timeout):
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
        logged = [line.removeprefix(LOGGED) for line in self._printed if line.startswith(LOGGED)]
        said = f": {' '.join(logged[-1].split())}" if logged else ""
        self._lost = SimulationError(
            f"{self.name}: the process of {self.interface.path.name} "
            f"{what or ended(self._process.returncode)} "
            f"at t = {self._exchange.clock[0]:.9g} s{said}{self._inputs}"
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
        end_group(self._process.pid)  # forks of it
        self._reader.join(OUTPUT_TIMEOUT)

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
