"""The process of a component: python -m grasp_cosim.fmi.worker serves one instance of an FMU.

Its arguments are the descriptors of the connection for commands, of the shared memory, and of a
pipe. The pipe is closed when the master's process ends; this one ends then, too. Commands, and what
comes of them: process.py.
"""

import faulthandler
import logging
import os
import pickle
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from itertools import count
from multiprocessing.connection import Connection
from typing import Any

from ..base import interruption
from ..base.calls import Call
from ..base.errors import InputError, SimulationError
from ..base.system_calls import end_fork
from ..interface.variables import Variable
from .instance import EARLY, OK, WARNING, Instance
from .load import load_here
from .messages import Message
from .shared_memory import LOGGED, STEP, SharedMemory


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

    def __init__(self, connection: Connection, shared: SharedMemory, log: _Log) -> None:
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
        _Worker(Connection(connection), SharedMemory(memory), log).serve()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # without what the FMU's library might do at exit


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
