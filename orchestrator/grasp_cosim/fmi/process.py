"""An instance of a component: in this process, or in one of its own, where it may crash or hang.

Both ends of such a process are here: python -m grasp_cosim.fmi.process serves, with the descriptors
of the connection for commands, of the shared memory and of a pipe that is closed when the master's
process ends, whereupon this one ends, too. A macro step is one round trip. The master puts inputs
and the time into the shared memory, sends STEP and waits for the status; the component's process
passes the inputs on that are pending, steps, fetches all outputs into the shared memory and
answers. All else is a method with its arguments, and answered by its value or error. What is logged
there comes with the answer, also with that of a step, and is logged here.

What the FMU prints does not get out, but for the last lines, as notes of the error when the process
is lost.
"""

import faulthandler
import logging
import mmap
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
from contextlib import ExitStack, suppress
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base import interruption
from ..base.calls import Call
from ..base.errors import InputError, SimulationError, ended
from ..base.scratch import ScratchFolder
from ..base.system_calls import end_fork, end_group, listener
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import Component, Logging, Solver
from .co_simulation import Fmi3Instance, FmuInstance, SharedInstance
from .instance import CLOCK, EARLY, OK, WARNING, Inputs, Instance, dtype
from .messages import Message, Messages
from .python_code import CodeInstance

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

STEP, FETCH = b"S", b"F"
"""Pass pending inputs on and step; pass them on and fetch outputs. Pickles are longer."""

LOGGED = "FMU: "
"""So begins what an FMU logged, among the lines that its process prints."""

SHARED_BYTES = 1 << 26
"""Of shared memory; only what is used of it takes memory."""


def load(component: Component) -> Instance:
    """The instance of a component, in a process of its own where it wants one.

    InputError where the FMU does not load. The caller closes it.
    """
    name, interface = component.name, component.loaded
    if component.code:
        return CodeInstance(name, component.code)
    if component.isolation == "process":
        solver, logging = component.solver, component.logging
        return ProcessInstance(name, interface, solver, logging, component.trace)
    if component.native and interface.version == "2.0":
        return SharedInstance(name, interface, logging=component.logging, trace=component.trace)
    return load_here(name, interface, component.solver, component.logging, component.trace)


def load_here(
    name: str,
    interface: Interface,
    solver: Solver | None = None,
    logging: Logging = False,
    trace: Path | None = None,
) -> Instance:
    """The instance of an FMU in this process.

    By model exchange where it has to be, or where there is a `solver` and the FMU is for that, too.
    The solver of a co-simulation FMU gets the relative tolerance of this one, or else that of the
    FMU's default experiment.
    """
    three = interface.version.startswith("3")
    exchanged = "CoSimulation" not in interface.kinds or (solver and interface.exchange)
    if not exchanged:
        tolerance = solver.relative_tolerance if solver else interface.tolerance
        if interface.event_mode:
            from .event_mode import EventInstance  # only here: few FMUs have it

            return EventInstance(name, interface, tolerance, logging, trace)
        kind = Fmi3Instance if three else FmuInstance
        return kind(name, interface, tolerance, logging, trace)
    try:
        from .model_exchange import Fmi2Model, Fmi3Model  # loads the solver's libraries
    except OSError as error:
        raise InputError(
            f"{name}: {interface.path.name} is for model exchange, and FMPy has no CVode for "
            f"this machine: {error}; must be a co-simulation FMU"
        ) from error
    model = Fmi3Model if three else Fmi2Model
    return model(name, interface, solver or Solver(), logging, trace)


class _SharedMemory:
    """The memory behind the file with the given descriptor, which both processes see."""

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, SHARED_BYTES)
        self.clock: npt.NDArray[np.float64] = self._view(np.float64, len(CLOCK), 0)
        """That of Instance.stepper."""
        self.step: npt.NDArray[np.float64] = self._view(np.float64, 1, self.clock.nbytes)
        """The length of the step in s."""
        self._used = self.clock.nbytes + self.step.nbytes

    def add(
        self, interface: Interface, variables: Sequence[Variable]
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[Any]]:
        """A mark that values of the variables are pending, and room for them.

        Both processes add the same variables in the same order and get the same room.
        """
        begin, count = self._used, len(variables)
        self._used += 8 + 8 * count
        element = dtype(interface.version, variables[0].type)
        return self._view(np.bool_, 1, begin), self._view(element, count, begin + 8)

    def saved(self) -> bytes:
        """What is in the room that was given out, for restore()."""
        return self._memory[: self._used]

    def clear(self) -> None:
        """Nothing is pending in it."""
        self._memory[: self._used] = bytes(self._used)

    def restore(self, saved: bytes) -> None:
        """Go back to what was saved."""
        self._memory[: len(saved)] = saved

    def _view(self, element: npt.DTypeLike, count: int, offset: int) -> npt.NDArray[Any]:
        return np.frombuffer(self._memory, element, count, offset)


class _RemoteState:
    """A state that the other process keeps, by its number, until nothing here refers to it."""

    def __init__(self, number: int, released: deque[int]) -> None:
        self.number, self._released = number, released

    def __del__(self) -> None:
        self._released.append(self.number)


class ProcessInstance:
    """One instance of an FMU in a process of its own, which ends with this one, however it ends."""

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
        self._shared = _SharedMemory(memory.fileno())
        master_end, component_end = socket.socketpair()
        self._connection = Connection(master_end.detach())
        reading, writing = os.pipe()
        self._stack.callback(os.close, writing)
        ends = (component_end.fileno(), memory.fileno(), reading)
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(  # noqa: S603
            [sys.executable, "-P", "-m", "grasp_cosim.fmi.process", *map(str, ends)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=ends,
            start_new_session=True,  # Ctrl-C is for the master alone
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
            f"{self.name}: the process of {self.interface.path.name} {ending} "
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


class _Log(logging.Handler):
    """Keeps what is logged for the next answer: level, text, and the message of the FMU.

    Prints it, too: this may be the last that comes of the process.
    """

    def __init__(self) -> None:
        super().__init__()
        self.records: list[tuple[int, str, Message | None]] = []

    def emit(self, record: logging.LogRecord) -> None:
        text, message = record.getMessage(), getattr(record, "fmu_message", None)
        self.records.append((record.levelno, text, message))
        sys.stdout.write(f"{LOGGED}{' '.join((message.text if message else text).split())}\n")
        sys.stdout.flush()

    def taken(self) -> list[tuple[int, str, Message | None]]:
        """The records since the last call."""
        records, self.records = self.records, []
        return records


class _Worker:
    """The other end: serves commands on one instance."""

    def __init__(self, connection: Connection, shared: _SharedMemory, log: _Log) -> None:
        self._connection = connection
        self._shared = shared
        self._log = log
        self._owner = os.getpid()
        self._instance: Instance
        self._inputs: list[tuple[Any, Call]] = []
        self._outputs: list[Call] = []
        self._states: dict[int, Any] = {}
        self._number = count()
        self._step: float | None = None
        self._advance: Call

    def serve(self) -> None:
        """Answer commands until one is to close."""
        method, answer = "", b""
        while method != "close":
            command = self._connection.recv_bytes()
            try:
                if len(command) == 1:
                    status = self._exchange(command)
                    self._instance.quieten()
                    answer = bytes([status])
                    if self._log.records:
                        answer = pickle.dumps((status, [], self._log.taken()))
                else:
                    method, arguments = pickle.loads(command)  # noqa: S301
                    with warnings.catch_warnings(record=True) as caught:
                        warnings.simplefilter("always")
                        value = self._call(method, arguments)
                        self._instance.quieten()
                    notes = [str(w.message) for w in caught]
                    answer = pickle.dumps((value, notes, self._log.taken()))
            except (InputError, SimulationError) as error:
                answer = pickle.dumps((error, [], self._log.taken()))
            end_fork(self._owner)
            self._connection.send_bytes(answer)

    def _exchange(self, command: bytes) -> int:
        self._pass_on()
        status = OK
        if command == STEP:
            step = float(self._shared.step[0])
            if step != self._step:
                self._step, self._advance = step, self._instance.stepper(self._shared.clock, step)
            status = self._status_of(self._advance)
        if status <= WARNING or status == EARLY:
            for call in self._outputs:
                self._check(self._status_of(call))
        return status

    def _status_of(self, call: Call) -> int:
        """The status of a call; a fork that the FMU made in it ends, and writes nothing."""
        status = call.python()
        end_fork(self._owner)
        return status

    def _pass_on(self) -> None:
        for pending, call in self._inputs:
            if pending[0]:
                pending[0] = False
                self._check(self._status_of(call))

    def _check(self, status: int) -> None:
        if status > WARNING:
            raise self._instance.failure(status, float(self._shared.clock[0]))

    def _call(self, method: str, arguments: tuple[Any, ...]) -> Any:
        if method == "load":
            self._instance = load_here(*arguments)
            return None
        if method == "transfer":
            return self._transfer(*arguments)
        if method == "keep_state":
            return self._keep_state(*arguments)
        if method == "restore_state":
            return self._instance.restore(self._states[arguments[0]])
        if method in ("get", "set"):
            self._pass_on()
        return getattr(self._instance, method)(*arguments)

    def _keep_state(self, released: Sequence[int]) -> int:
        """Keep the state of now, and those that were released no more; its number."""
        for number in released:
            del self._states[number]
        self._states[number := next(self._number)] = self._instance.saved()
        return number

    def _transfer(self, action: str, variables: Sequence[Variable]) -> None:
        pending, data = self._shared.add(self._instance.interface, variables)
        call = self._instance.transfer(action, variables, data)
        if action == "set":
            self._inputs.append((pending, call))
        else:
            self._outputs.append(call)


def main(connection: int, memory: int, lifeline: int) -> None:
    """Serve until the instance is closed."""
    faulthandler.enable()
    log = _Log()
    logging.basicConfig(handlers=[log], level=logging.INFO)
    interruption.worker(lifeline)
    with suppress(EOFError):  # where the master wants no more of it
        _Worker(Connection(connection), _SharedMemory(memory), log).serve()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # without what the FMU's library might do at exit


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
