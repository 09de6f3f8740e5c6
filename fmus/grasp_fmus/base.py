"""A slave behind pythonfmu's FMI 2.0 interface: life cycle, typed values, checks, log.

Value references are positions in one list of values. A call that is refused has no effect and
leaves its reason in the log of the host.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from math import inf, isclose, isfinite
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

from .host_log import CATEGORIES, ERROR, as_format, host_log
from .loader import Component, Once, forget, survive
from .variable import TYPES, Scalar, Variable

INSTANTIATED, INITIALISING, STEPPING, TERMINATED = range(4)
PHASES = "before initialisation", "in initialisation mode", "in step mode", "after fmi2Terminate"

TIME_TOLERANCE = 1e-9
"""How far, in s, the host's clock may be from the slave's; relative to the time it is 1e-12."""


class RefusalError(Exception):
    """A call was refused, for the reason given."""


class LoggedError(Exception):
    """A call failed, for a reason that is in the log of the host."""

    def __repr__(self) -> str:
        """What pythonfmu adds while debug logging is on, as a format of printf."""
        return "failed, for the reason logged before"


class Message(NamedTuple):
    """A message for pythonfmu's own log."""

    status: int
    category: str
    msg: str


@dataclass(frozen=True, slots=True)
class Access:
    """How a list of value references is read or written; worked out once per list and phase."""

    vrs: list[int]
    where: slice | None
    """None: not in a row."""
    outputs: bool
    parameters: bool
    limited: bool


_NONE = Access([], None, False, False, False)
"""How to read or write nothing, which is always allowed."""


_P = ParamSpec("_P")
_R = TypeVar("_R")
_S = TypeVar("_S", bound="Slave")


def reported(call: Callable[Concatenate[_S, _P], _R]) -> Callable[Concatenate[_S, _P], _R]:
    """The call, with what it raises in the log. In the calls of every step it is written out."""

    @wraps(call)
    def reporting(self: _S, /, *arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return call(self, *arguments, **named)
        except BaseException as error:
            raise self._reported(error) from None

    return reporting


def _getter(kind: type[Scalar]) -> Callable[[Any, list[int]], list[Any]]:
    def get(self: "Slave", vrs: list[int]) -> list[Any]:
        """Values of the given references."""
        try:
            access = self._last_read[kind]
            if vrs != access.vrs:
                access = self._reads[kind].get(tuple(vrs)) or self._access(vrs, kind, False)
                self._last_read[kind] = access
            if self._inputs is None and access.outputs:
                self._refresh()
        except BaseException as error:
            raise self._reported(error) from None
        where = access.where
        return self._values[where] if where else [self._values[vr] for vr in vrs]

    return get


def _setter(kind: type[Scalar]) -> Callable[[Any, list[int], list[Any]], None]:
    real = kind is float

    def set_(self: "Slave", vrs: list[int], values: list[Any]) -> None:
        """Set inputs or parameters, all or none; outputs follow when they are next asked for."""
        try:
            access = self._last_write[kind]
            if vrs != access.vrs:
                access = self._writes[kind].get(tuple(vrs)) or self._access(vrs, kind, True)
                self._last_write[kind] = access
            if access.limited or (real and not isfinite(sum(values))):
                self._check_values(vrs, values)
        except BaseException as error:
            raise self._reported(error) from None
        if access.where:
            self._values[access.where] = values
        else:
            for vr, value in zip(vrs, values, strict=True):
                self._values[vr] = value
        if access.parameters:
            self._params = None
        self._inputs = None

    return set_


class Slave(metaclass=Once):
    """An FMI 2.0 co-simulation slave, as pythonfmu calls it.

    A subclass makes _variables and _values in _prepare(), brings outputs up to date in _refresh(),
    steps in do_step(), and has the four functions of states.
    """

    _variables: list[Variable]
    _values: list[Any]
    state_to_bytes: Callable[[Any], bytes]
    state_from_bytes: Callable[[bytes], Any]

    def __init__(
        self,
        component: Component,
        instance_name: bytes | str,
        resources: str,
        logger: int,
        visible: int,
    ) -> None:
        """As pythonfmu calls it: logger is the address of its logger.

        The name is bytes on Linux, and may be no UTF-8.
        """
        forget(resources)
        name = instance_name.encode() if isinstance(instance_name, str) else instance_name
        self.instance_name = name.decode(errors="replace")
        self.log_queue: list[Message] = []
        self._component = component
        self._host_log = host_log(logger, name)
        self._time = 0.0
        self._params: Any = None  # None: one was set and they are to be read again
        self._inputs: Any = None  # None: something was set and the outputs are out of date
        reported(type(self)._prepare)(self)

    def _prepare(self) -> None:
        """Make what an instance has; then _enter(INSTANTIATED)."""
        raise NotImplementedError

    def _refresh(self) -> None:
        """Bring the outputs up to date, and set _inputs; RefusalError where that cannot be."""
        raise NotImplementedError

    def _enter(self, phase: int) -> None:
        self._phase = phase
        self._reads = {kind: dict[tuple[int, ...], Access]() for kind in TYPES}
        self._writes = {kind: dict[tuple[int, ...], Access]() for kind in TYPES}
        # The last of each: the host nearly always asks for the same again
        self._last_read, self._last_write = dict.fromkeys(TYPES, _NONE), dict.fromkeys(TYPES, _NONE)

    # The life cycle

    @reported
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Time starts at start_time, in s."""
        self._require("fmi2SetupExperiment", INSTANTIATED)
        if not isfinite(start_time):
            raise RefusalError(f"start time = {start_time} s: must be a finite number")
        self._time = start_time

    @reported
    def enter_initialization_mode(self) -> None:
        """Refuse parameters set so far that do not go together."""
        self._require("fmi2EnterInitializationMode", INSTANTIATED)
        self._refresh()
        self._enter(INITIALISING)

    @reported
    def exit_initialization_mode(self) -> None:
        """Outputs are those of the parameters and inputs set so far."""
        self._require("fmi2ExitInitializationMode", INITIALISING)
        self._refresh()
        self._enter(STEPPING)

    def terminate(self) -> None:
        """The end; values can still be read."""
        self._enter(TERMINATED)

    # Values

    get_real, set_real = _getter(float), _setter(float)
    get_boolean, set_boolean = _getter(bool), _setter(bool)
    get_integer, set_integer = _getter(int), _setter(int)
    get_string, set_string = _getter(str), _setter(str)

    # Checks

    def _require(self, call: str, phase: int) -> None:
        if self._phase != phase:
            raise RefusalError(f"{call} {PHASES[self._phase]}: must be {PHASES[phase]}")

    def _check_step(self, current_time: float, step_size: float) -> None:
        self._require("fmi2DoStep", STEPPING)
        if not 0.0 < step_size < inf:
            raise RefusalError(f"step size = {step_size} s: must be a finite number above 0")
        if not isclose(current_time, self._time, rel_tol=1e-12, abs_tol=TIME_TOLERANCE):
            raise RefusalError(f"step from {current_time} s: must be from {self._time} s")

    def _access(self, vrs: list[int], kind: type[Scalar], to_set: bool) -> Access:
        """How to read or set these variables; RefusalError where that is not allowed now."""
        self._check_references(vrs, kind)
        variables = [self._variables[vr] for vr in vrs]
        if to_set:
            for v in variables:
                self._check_settable(v)
        accesses = self._writes[kind] if to_set else self._reads[kind]
        row = range(vrs[0], vrs[0] + len(vrs)) if vrs else range(0)
        access = Access(
            list(vrs),
            slice(row.start, row.stop) if vrs == list(row) else None,
            any(v.causality == "output" for v in variables),
            any(v.causality == "parameter" for v in variables),
            any(v.limits for v in variables),
        )
        if len(accesses) == 64:  # so that no host can fill the memory
            accesses.clear()
        accesses[tuple(vrs)] = access
        return access

    def _check_references(self, vrs: list[int], kind: type[Scalar]) -> None:
        if vrs and not any(v.kind is kind for v in self._variables):
            raise RefusalError(f"value reference {vrs[0]}: there is no {TYPES[kind]} variable")
        for vr in vrs:
            if not 0 <= vr < len(self._variables):
                last = len(self._variables) - 1
                raise RefusalError(f"value reference {vr}: must be from 0 to {last}")
            v = self._variables[vr]
            if v.kind is not kind:
                wrong, right = TYPES[kind], TYPES[v.kind]
                raise RefusalError(f"{v.name}: accessed as {wrong}: must be as {right}")

    def _check_settable(self, v: Variable) -> None:
        if v.causality == "output":
            raise RefusalError(f"{v.name}: output set: must be an input or a parameter")
        if self._phase == TERMINATED:
            raise RefusalError(f"{v.name}: set after fmi2Terminate: must be before")
        if self._phase == STEPPING and v.variability == "fixed":
            raise RefusalError(
                f"{v.name}: fixed parameter set in step mode: must be before "
                "fmi2ExitInitializationMode"
            )

    def _check_values(self, vrs: list[int], values: list[Any]) -> None:
        for vr, value in zip(vrs, values, strict=True):
            try:
                self._variables[vr].check(value)
            except ValueError as error:
                raise RefusalError(str(error)) from error

    # Reports

    def _reported(self, error: BaseException) -> LoggedError:
        """Log an exception that would leave the slave; what leaves it instead."""
        self._inputs = None  # the outputs may not have been worked out
        if isinstance(error, RefusalError):
            self._log(ERROR, str(error))
        else:
            from traceback import format_exception  # only a bug needs it

            self._log(ERROR, "".join(format_exception(error)).strip())
        survive((self._component, self, self.log_queue))
        return LoggedError()

    def _log(self, status: int, text: str) -> None:
        message = f"{self.instance_name}, t = {self._time:.9g} s: {text}"
        if self._host_log is not None:
            self._host_log(status, message)
        else:
            self.log_queue.append(Message(status, CATEGORIES[status], as_format(message)))

    def _get_log_queue(self) -> list[Message]:
        return self.log_queue
