"""An instance of an FMI 3.0 co-simulation FMU.

Without event mode and intermediate update. A step may end early where the FMU declares that it
might and that its step may vary; the master then does the rest. Clocks and binaries are left alone.
"""

import ctypes
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.fmi3 import _FMU3, FMU3Slave

from ..base.calls import STEP_3, TRANSFER_3, Call, Native
from ..interface.interface import Interface, Value, Variable
from .instance import EARLY, WARNING
from .loaded import KEPT, LoadedInstance, keep_message, know_signatures

TERMINATE, SHORT = 1, 2
"""Places in the flags of a step, after that of an event."""


class Lenient(_FMU3):  # type: ignore[misc]  # FMPy has no types
    """FMPy's, but for an FMU without the functions of other kinds of FMUs."""

    def __dir__(self) -> Iterable[str]:
        """FMPy loads the functions by these names; it raises where one is missing."""
        return [n for n in super().__dir__() if n[:4] != "fmi3" or hasattr(self.dll, n)]

    def getString(self, references: Sequence[int]) -> list[bytes | None]:
        """As they are: FMPy's raises at what is no UTF-8, and at NULL."""
        count = len(references)
        texts = (ctypes.c_char_p * count)()
        self.fmi3GetString(
            self.component, (ctypes.c_uint * count)(*references), count, texts, count
        )
        return list(texts)


class _Slave(Lenient, FMU3Slave):  # type: ignore[misc]
    pass


class Fmi3Instance(LoadedInstance):
    """One instance of an FMI 3.0 co-simulation FMU."""

    PREFIX = "fmi3"
    SHAPE = TRANSFER_3
    ENUMERATION = "Int64"

    def __init__(self, name: str, interface: Interface) -> None:
        """Extract and instantiate; InputError where the FMU does not load."""
        self._said: deque[str] = deque(maxlen=KEPT)
        self._flags = np.zeros(3, np.bool_)
        self._last = np.zeros(1)
        super().__init__(name, interface)

    def _instantiate(self, folder: Path) -> FMU3Slave:
        slave = know_signatures(_Slave)(
            guid=self.interface.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self._identifier,
            instanceName=self.name,
        )
        early_return = self.interface.capability("mightReturnEarlyFromDoStep") is True
        slave.instantiate(
            loggingOn=True,
            earlyReturnAllowed=early_return and self.interface.can_vary_step,
            logMessage=self._log,
        )
        return slave

    def _log(self, _: Any, status: int, category: Any, message: bytes | None) -> None:
        keep_message(self._said, status, message)

    def _read_log(self) -> list[str]:
        said = list(self._said)
        self._said.clear()
        return said

    def _start(self, values: Mapping[str, Value], stop: float | None, start: float) -> None:
        structural: list[tuple[Variable, Value]] = []
        others: list[tuple[Variable, Value]] = []
        for name, value in values.items():
            variable = self.interface.by_name[name]
            sizing = variable.causality == "structuralParameter"
            (structural if sizing else others).append((variable, value))
        if structural:
            self._slave.enterConfigurationMode()
            self._assign(structural, fetch=False)
            self._slave.exitConfigurationMode()
        self._assign(others, fetch=False)
        self._slave.enterInitializationMode(self.tolerance, startTime=start, stopTime=stop)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        flags, last = self._flags.ctypes.data, self._last.ctypes.data
        places = (ctypes.c_void_p(place) for place in (flags, flags + 1, flags + 2, last))
        bound, address = self._stepping(clock, step, ctypes.c_bool(True), *places)
        said = memoryview(self._flags)  # type: ignore[arg-type]

        def advance() -> int:
            status = bound()
            return EARLY if status <= WARNING and (said[TERMINATE] or said[SHORT]) else status

        native = Native(STEP_3, address, self._slave.component, step=step, flags=flags, last=last)
        return Call(advance, native, self._python)

    def _wants_the_end(self) -> bool:
        return bool(self._flags[TERMINATE])

    def last_successful_time(self) -> float | None:
        """A step that was discarded did nothing; what the flags say is then of an earlier one."""
        said = self._flags[SHORT] or self._flags[TERMINATE]
        return float(self._last[0]) if said else self._time()
