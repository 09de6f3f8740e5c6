"""An instance of a component in its own process, where it may crash or hang.

This is the master's end; the other one is worker.py. A macro step is one round trip. The master
puts inputs and the time into the shared memory, sends STEP and waits for the status; the
component's process passes the inputs on that are pending, steps, fetches all outputs into the
shared memory and answers. All else is a method with its arguments, and answered by its value or
error. What is logged there comes with the answer, also with that of a step, and is logged here.

What the FMU prints does not get out, but for the last lines, as notes of the error when the process
is lost.
"""

import logging
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
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import InputError, SimulationError, ended
from ..base.scratch import ScratchFolder
from ..base.system_calls import end_fork, end_group, listener
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import Logging, Solver
from .instance import EARLY, WARNING, Inputs
from .messages import Message, Messages
from .shared_memory import FETCH, LOGGED, SHARED_BYTES, STEP, SharedMemory

LOGGER = logging.getLogger(__name__)
"""Gets what is logged in the process of a component, but for the messages of its FMU."""

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

MAX_LINES = 80
"""The last lines of what an FMU printed that are kept for the error: of a crash both stacks."""


class _RemoteState:
    """A state that the other process keeps, by its number, until nothing here refers to it."""

    def __init__(self, number: int, released: deque[int]) -> None:
        self.number, self._released = number, released

    def __del__(self) -> None:
        self._released.append(self.number)


class ProcessInstance:
    """One instance of an FMU in its own process, which ends with this one, however it ends."""

    def __init__(
        self,
        name: str,
        interface: Interface,
        solver: Solver | None = None,
        logging: Logging = False,
        trace: Path | None = None,
    ) -> None:
        """Start the process and instantiate; InputError where the FMU does not load."""
        self.name = name
        self.interface = interface
        self._owner = os.getpid()
        self._messages = Messages(name, logging, lambda: float(self._shared.clock[0]))
        self._has_fresh_outputs = False
        self._released: deque[int] = deque()
        self._inputs = Inputs()
        if not POSIX:
            raise InputError(
                f"{name}: isolation = 'process' needs Linux or macOS; must be 'none' here"
            )
        self._stack = ExitStack()
        self._loss: SimulationError | None = None
        self._printed: deque[str] = deque(maxlen=MAX_LINES)
        folder = self._stack.enter_context(ScratchFolder()).name
        memory = self._stack.enter_context(tempfile.TemporaryFile())  # noqa: SIM115
        memory.truncate(SHARED_BYTES)
        self._shared = SharedMemory(memory.fileno())
        master_end, component_end = socket.socketpair()
        self._connection = Connection(master_end.detach())
        reading, writing = os.pipe()
        self._stack.callback(os.close, writing)
        ends = (component_end.fileno(), memory.fileno(), reading)
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-m", "grasp_cosim.fmi.worker", *map(str, ends)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=ends,
            start_new_session=True,  # Ctrl-C is for the master only
            env={**os.environ, "PYTHONPATH": path, "TMPDIR": folder},
            text=True,
            errors="replace",
        )
        component_end.close()
        os.close(reading)
        self._answers = listener(self._connection)
        self._reader = threading.Thread(target=self._read_output, daemon=True)
        self._reader.start()
        try:
            self._prepare("load", name, interface, solver, logging, trace)
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
            if self._loss is None:
                self._ask("close", timeout=END_TIMEOUT)
        except SimulationError as error:
            LOGGER.warning("%s, while it was closed", error)
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

    def enter_step_mode(self) -> None:
        self._prepare("enter_step_mode")

    def through_events(self, status: int, begin: float, end: float) -> tuple[int, float]:
        self._has_fresh_outputs = False
        outcome: tuple[int, float] = self._ask("through_events", status, begin, end)
        return outcome

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        values: list[Value] = self._ask("get", list(variables))
        return values

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        self._has_fresh_outputs = False
        for variable, value in zip(variables, values, strict=True):
            self._inputs.set(variable, value)
        self._ask("set", list(variables), list(values))

    def saved(self) -> Any:
        """As Instance.saved(), with what is on the way."""
        released = [self._released.popleft() for _ in range(len(self._released))]
        state = _RemoteState(self._ask("keep_state", released), self._released)
        on_the_way = self._has_fresh_outputs, self._shared.saved()
        return state, on_the_way, self._inputs.saved(), self._messages.saved()

    def restore(self, saved: Any) -> None:
        state, (fresh, shared), inputs, messages = saved
        self._ask("restore_state", state.number)
        self._has_fresh_outputs = fresh
        self._shared.restore(shared)
        self._inputs.restore(inputs)
        self._messages.restore(messages)

    def reset(self) -> None:
        self._ask("reset", timeout=START_TIMEOUT)
        self._has_fresh_outputs = False
        self._shared.clear()
        self._inputs.forget()
        self._messages.forget()

    def numbers(self) -> npt.NDArray[np.float64]:
        numbers: npt.NDArray[np.float64] = self._ask("numbers")
        return numbers

    def take_numbers(self, numbers: npt.NDArray[np.float64]) -> bool:
        return bool(self._ask("take_numbers", numbers))

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """As Instance.transfer: inputs arrive with the next step, and outputs come with it."""
        pending, shared = self._shared.add(self.interface, variables)
        self._ask("transfer", action, list(variables))
        if action == "set":
            self._inputs.bind(variables, data)

        def put() -> int:
            end_fork(self._owner)  # of an FMU in this process; the memory is not its own
            self._has_fresh_outputs = False
            shared[:] = data
            pending[0] = True
            return 0

        def fetch() -> int:
            if not self._has_fresh_outputs:
                self._pass_values(FETCH)
            data[:] = shared
            return 0

        return Call(put if action == "set" else fetch)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        shared = self._shared

        def advance() -> int:
            end_fork(self._owner)
            shared.clock[:] = clock
            shared.step[0] = step
            return self._pass_values(STEP)

        return Call(advance)

    def last_successful_time(self) -> float | None:
        time: float | None = self._ask("last_successful_time")
        return time

    def the_end(self) -> float | None:
        time: float | None = self._ask("the_end")
        return time

    def remarks(self, returned: int = 0, first: float = 0.0) -> list[str]:
        return self._messages.remarks(returned, first)

    def quieten(self) -> None:
        """The other process does so itself."""

    def failure(self, status: int, time: float) -> SimulationError:
        self._messages.reasons()  # the error there has them
        try:
            return self._ask("failure", status, time)  # type: ignore[no-any-return]
        except SimulationError as error:
            return error

    def _pass_values(self, command: bytes) -> int:
        """STEP or FETCH; the FMI status."""
        self._has_fresh_outputs = False
        status: int = self._request(command, TIMEOUT)
        self._has_fresh_outputs = status <= WARNING or status == EARLY
        return status

    def _ask(self, method: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
        """The value of a method in the other process; what it raises there is raised here."""
        return self._request(pickle.dumps((method, arguments)), timeout)

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

    def _request(self, command: bytes, timeout: float) -> Any:
        if self._loss is not None:
            raise self._loss
        end_fork(self._owner)
        try:
            self._connection.send_bytes(command)
            if not self._answers(timeout):
                self._process.kill()
                raise self._lose(f"did not answer within {timeout:g} s and was ended")
            answer = self._connection.recv_bytes()
        except (EOFError, OSError) as error:
            raise self._lose() from error
        except KeyboardInterrupt:  # an answer on the way would be taken for the next one
            self._process.kill()
            self._lose("was interrupted and ended")
            raise
        if len(answer) == 1:
            return answer[0]
        value, notes, records = pickle.loads(answer)  # noqa: S301
        for record in records:
            self._take(*record)
        if isinstance(value, Exception):
            raise value
        for text in notes:
            warnings.warn(text, stacklevel=3)
        return value

    def _take(self, level: int, text: str, message: Message | None) -> None:
        """Log here what was logged in the other process."""
        if message is None:
            LOGGER.log(level, "%s", text)
        else:
            self._messages.keep(message)

    def _lose(self, ending: str = "") -> SimulationError:
        """The error for a process that has ended, or is about to; `ending` says how it did.

        Without that its exit code says it.
        """
        self._wait_for_the_end()
        if not ending:
            ending = ended(self._process.returncode)
        logged = [line.removeprefix(LOGGED) for line in self._printed if line.startswith(LOGGED)]
        reason = f": {' '.join(logged[-1].split())}" if logged else ""
        self._loss = SimulationError(
            f"{self.name}: the process of {self.interface.file_name} {ending} "
            f"at t = {self._shared.clock[0]:.9g} s{reason}{self._inputs}"
        )
        for line in self._printed:
            self._loss.add_note(line.rstrip())
        return self._loss

    def _wait_for_the_end(self) -> None:
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        end_group(self._process.pid)  # forks of it
        self._reader.join(OUTPUT_TIMEOUT)
