"""The process of a component with isolation = "process": python -m grasp_cosim.fmi.worker.

Its arguments are the descriptors of the connection for commands, of the shared memory and of a pipe
that is closed when the master's process ends, whereupon this one ends, too.
"""

import faulthandler
import logging
import os
import sys
import warnings
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from ..base import interruption
from ..base.calls import Call
from ..base.errors import InputError, SimulationError
from .instance import EARLY, WARNING, Instance
from .make_instance import load_here
from .shared_memory import ANSWER, CALL, LOGGED, STEP, SharedMemory

Answer = tuple[str, Any, list[str]]
"""The kind of an answer ("value" or an error's name), its value, and notes or warnings."""


class Worker:
    """Serves commands on one instance."""

    def __init__(self, connection: Connection, exchange: SharedMemory) -> None:
        self._connection = connection
        self._exchange = exchange
        self._instance: Instance
        self._inputs: list[tuple[Any, Call]] = []
        self._outputs: list[Call] = []
        self._step: float | None = None
        self._advance: Call

    def serve(self) -> None:
        """Answer commands until one is to close."""
        closed = False
        while not closed:
            command = self._connection.recv_bytes()
            if command == CALL:
                method, arguments = self._connection.recv()
                self._send(self._answer(method, arguments))
                closed = method == "close"
            else:
                self._exchange_values(command)

    def _exchange_values(self, command: bytes) -> None:
        try:
            status = self._do_step() if command == STEP else self._fetch()
        except SimulationError as error:
            self._send(_as_answer(error))
        else:
            self._connection.send_bytes(bytes([status]))

    def _do_step(self) -> int:
        self._pass_on()
        step = float(self._exchange.step[0])
        if step != self._step:
            self._step, self._advance = step, self._instance.stepper(self._exchange.clock, step)
        status = self._advance.python()
        if status <= WARNING or status == EARLY:
            self._fetch()
        return status

    def _pass_on(self) -> None:
        for pending, call in self._inputs:
            if pending[0]:
                pending[0] = False
                self._check(call.python())

    def _fetch(self) -> int:
        self._pass_on()
        for call in self._outputs:
            self._check(call.python())
        return 0

    def _check(self, status: int) -> None:
        if status > WARNING:
            raise self._instance.failure(status, float(self._exchange.clock[0]))

    def _send(self, answer: Answer) -> None:
        self._connection.send_bytes(bytes([ANSWER]))
        self._connection.send(answer)

    def _answer(self, method: str, arguments: tuple[Any, ...]) -> Answer:
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                value = self._call(method, arguments)
            return "value", value, [str(warning.message) for warning in caught]
        except (InputError, SimulationError) as error:
            return _as_answer(error)

    def _call(self, method: str, arguments: tuple[Any, ...]) -> Any:
        if method == "load":
            self._instance = load_here(*arguments)
            return None
        if method == "transfer":
            return self._transfer(*arguments)
        if method == "failure":
            raise self._instance.failure(*arguments)
        if method in ("get", "set"):
            self._pass_on()
        return getattr(self._instance, method)(*arguments)

    def _transfer(self, action: str, variables: Any) -> None:
        pending, data = self._exchange.add(self._instance.interface, variables)
        call = self._instance.transfer(action, variables, data)
        if action == "set":
            self._inputs.append((pending, call))
        else:
            self._outputs.append(call)


def _as_answer(error: Exception) -> Answer:
    """An InputError or SimulationError on its way to the master's process."""
    return type(error).__name__, str(error), list(getattr(error, "__notes__", []))


def main(connection: int, memory: int, lifeline: int) -> None:
    """Serve until the instance is closed."""
    faulthandler.enable()
    logging.basicConfig(format=f"{LOGGED}%(message)s", level=logging.INFO)
    interruption.worker(lifeline)
    with suppress(EOFError):  # where the master wants no more of it
        Worker(Connection(connection), SharedMemory(memory)).serve()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # without what the FMU's library might do at exit


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
