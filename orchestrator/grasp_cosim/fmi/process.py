"""An instance whose FMU lives in a process of its own: it may crash there, or hang."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError, SimulationError
from ..interface.interface import Interface, Value, Variable
from .child import Child
from .exchange import FETCH, STEP
from .instance import EARLY, WARNING, Call

POSIX = os.name == "posix"
"""Elsewhere a process is not handed open files."""


class ProcessInstance:
    """One instance of a co-simulation FMU in a process of its own."""

    def __init__(self, name: str, interface: Interface) -> None:
        """Start the process and instantiate; InputError where the FMU does not load."""
        self.name = name
        self.interface = interface
        self._fresh = False
        if not POSIX:
            raise InputError(
                f"{name}: isolation = 'process' needs Linux or macOS; must be 'none' here"
            )
        self._child = Child(name, interface.path.name)
        try:
            self._child.start("load", name, interface)
        except BaseException:
            self._child.end()
            raise

    def close(self) -> None:
        """Terminate and free the FMU as far as it permits, and end its process."""
        self._child.close()

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        """Set start values and enter initialisation mode; the times are in s."""
        self._child.start("enter_initialization", dict(values), stop, start)

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""
        self._child.start("exit_initialization")

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        """The values of the variables now, one by one. For use outside the loop."""
        values: list[Value] = self._child.ask("get", list(variables))
        return values

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        """Set inputs or tunable parameters. For use outside the loop."""
        self._fresh = False
        self._child.ask("set", list(variables), list(values))

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """The call that passes data to inputs ("set") or fetches outputs into it ("get").

        Inputs arrive with the next step, and outputs come with it.
        """
        pending, shared = self._child.exchange.add(self.interface, variables)
        self._child.ask("transfer", action, list(variables))

        def put() -> int:
            self._fresh = False
            shared[:] = data
            pending[0] = True
            return 0

        def fetch() -> int:
            if not self._fresh:
                self._exchange_values(FETCH)
            data[:] = shared
            return 0

        return Call(put if action == "set" else fetch)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        """The call that advances by step seconds from the time in clock[0]; EARLY is a status."""
        exchange = self._child.exchange

        def advance() -> int:
            exchange.clock[0] = clock[0]
            exchange.step[0] = step
            return self._exchange_values(STEP)

        return Call(advance)

    def last_successful_time(self) -> float | None:
        """Return the end of a discarded or shortened step in s, None if the FMU does not say."""
        time: float | None = self._child.ask("last_successful_time")
        return time

    def failure(self, status: int, time: float) -> SimulationError:
        """The error for a call that returned a bad status at time in s."""
        try:
            return self._child.ask("failure", status, time)  # type: ignore[no-any-return]
        except SimulationError as error:
            return error

    def _exchange_values(self, command: bytes) -> int:
        """One round trip; the FMI status."""
        self._fresh = False
        status = self._child.exchange_values(command)
        self._fresh = status <= WARNING or status == EARLY
        return status
