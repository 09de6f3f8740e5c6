"""The slave that runs a block behind pythonfmu's FMI 2.0 interface.

Value references are positions in one list of values: inputs, outputs, parameters, in the order of
declaration. Outputs are worked out when they are asked for, from the state and the inputs of that
moment, so they agree with the inputs in initialisation mode and after every set.

A call that is refused has no effect and leaves its reason in the log of the host.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from math import inf, isclose, isfinite
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

from .contract import Block, build_params, count, declared, packer, unpacker
from .host_log import CATEGORIES, as_format, host_log
from .loader import Component, Once, forget, survive
from .snapshot import Snapshot, from_bytes, to_bytes

INSTANTIATED, INITIALISING, STEPPING, TERMINATED = range(4)
PHASES = (
    "before initialisation",
    "in initialisation mode",
    "in step mode",
    "after fmi2Terminate",
)

DISCARD, ERROR = 2, 3
"""FMI statuses."""

_TYPES = {float: "Real", bool: "Boolean"}

MOST_ACCESSES = 64
"""How many lists of value references are remembered, so that no host can fill the memory."""

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


Accesses = dict[tuple[int, ...], Access]
"""By the list of value references."""

_NONE = Access([], None, False, False, False)
"""How to read or write nothing, which is always allowed."""


_P = ParamSpec("_P")
_R = TypeVar("_R")
_Method = Callable[Concatenate["Fmi2Slave", _P], _R]


def _reported(call: _Method[_P, _R]) -> _Method[_P, _R]:
    """The call, with what it raises in the log. In the calls of every step it is written out."""

    @wraps(call)
    def reported(self: "Fmi2Slave", /, *arguments: _P.args, **named: _P.kwargs) -> _R:
        try:
            return call(self, *arguments, **named)
        except BaseException as error:
            raise self._reported(error) from None

    return reported


class Fmi2Slave(metaclass=Once):
    """A block as an FMI 2.0 co-simulation slave; a subclass names the block.

    pythonfmu's loader looks for a class that derives from one of this name.
    """

    block: Block

    def __init__(
        self, component: Component, instance_name: str, resources: str, logger: int, visible: int
    ) -> None:
        """As pythonfmu calls it: logger is the address of its logger."""
        forget(resources)
        self.instance_name = instance_name
        self.log_queue: list[Message] = []
        self._component = component
        self._host_log = host_log(logger, instance_name)
        self._time = 0.0
        try:
            self._prepare()
        except BaseException as error:
            raise self._reported(error) from None

    def _prepare(self) -> None:
        self._fields = declared(self.block)
        self._names = [(f, name) for f in self._fields for name in f.names]
        self._values: list[Any] = [start for f in self._fields for start in f.starts]
        self._first_output = count(self._fields, "input")
        self._first_parameter = count(self._fields, "input", "output")
        self._outputs = slice(self._first_output, self._first_parameter)
        self._functions = (
            self.block.step,
            self.block.outputs,
            packer(self.block.Inputs, self._fields),
            unpacker(self._fields),
        )
        self._params: Any = None
        self._inputs: Any = None  # None: something was set and the outputs are out of date
        self._state = self.block.initial_state(self.block.Params(), self.block.Inputs())
        self._enter(INSTANTIATED)

    def _enter(self, phase: int) -> None:
        self._phase = phase
        self._real_reads: Accesses = {}
        self._boolean_reads: Accesses = {}
        self._real_writes: Accesses = {}
        self._boolean_writes: Accesses = {}
        # The last of each: the host nearly always asks for the same again
        self._real_read = self._boolean_read = self._real_write = _NONE

    # The life cycle

    @_reported
    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """Time starts at start_time, in s."""
        self._require("fmi2SetupExperiment", INSTANTIATED)
        if not isfinite(start_time):
            raise RefusalError(f"start time = {start_time} s: must be a finite number")
        self._time = start_time

    @_reported
    def enter_initialization_mode(self) -> None:
        """Refuse parameters set so far that the block refuses."""
        self._require("fmi2EnterInitializationMode", INSTANTIATED)
        self._refresh()
        self._enter(INITIALISING)

    @_reported
    def exit_initialization_mode(self) -> None:
        """Fix the initial state from the parameters and inputs set so far."""
        self._require("fmi2ExitInitializationMode", INITIALISING)
        self._refresh()
        self._enter(STEPPING)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the block by step_size seconds with the inputs as they are.

        Returns False, and stays where it is, if the outputs would not be finite.
        """
        try:
            if not (
                self._phase == STEPPING
                and 0.0 < step_size < inf
                and -TIME_TOLERANCE <= current_time - self._time <= TIME_TOLERANCE
            ):
                self._check_step(current_time, step_size)
            step, evaluate, pack, unpack = self._functions
            params, inputs = self._params, self._inputs
            if inputs is None:
                if params is None:
                    params = self._read_params()
                self._inputs = inputs = pack(self._values)
            try:
                state = step(params, self._state, inputs, step_size)
                values = unpack(evaluate(params, state, inputs))
            except ArithmeticError as error:
                return self._discard(step_size, f"{type(error).__name__}: {error}")
            if not isfinite(sum(values)) and (text := self._not_finite(values)):
                return self._discard(step_size, text)
        except BaseException as error:
            raise self._reported(error) from None
        self._state = state
        self._values[self._outputs] = values
        self._time = current_time + step_size
        return True

    def terminate(self) -> None:
        """The end; values can still be read."""
        self._enter(TERMINATED)

    # Values

    def get_real(self, vrs: list[int]) -> list[Any]:
        """Values of the given references."""
        try:
            access = self._real_read
            if vrs != access.vrs:
                access = self._real_reads.get(tuple(vrs)) or self._readable(vrs, float)
                self._real_read = access
            if self._inputs is None and access.outputs:
                self._refresh()
        except BaseException as error:
            raise self._reported(error) from None
        where = access.where
        return self._values[where] if where else [self._values[vr] for vr in vrs]

    def get_boolean(self, vrs: list[int]) -> list[Any]:
        """Values of the given references."""
        try:
            access = self._boolean_read
            if vrs != access.vrs:
                access = self._boolean_reads.get(tuple(vrs)) or self._readable(vrs, bool)
                self._boolean_read = access
            if self._inputs is None and access.outputs:
                self._refresh()
        except BaseException as error:
            raise self._reported(error) from None
        where = access.where
        return self._values[where] if where else [self._values[vr] for vr in vrs]

    def get_integer(self, vrs: list[int]) -> list[Any]:
        """There are no integers."""
        return self._none_of("Integer", vrs)

    def get_string(self, vrs: list[int]) -> list[Any]:
        """There are no strings."""
        return self._none_of("String", vrs)

    def set_real(self, vrs: list[int], values: list[Any]) -> None:
        """Set inputs or parameters, all or none; outputs follow when they are next asked for."""
        try:
            access = self._real_write
            if vrs != access.vrs:
                access = self._real_writes.get(tuple(vrs)) or self._writable(vrs, float)
                self._real_write = access
            if access.limited or not isfinite(sum(values)):
                self._check_values(vrs, values)
        except BaseException as error:
            raise self._reported(error) from None
        if access.parameters or not access.where:
            self._store(vrs, values, access)
        else:
            self._values[access.where] = values
            self._inputs = None

    @_reported
    def set_boolean(self, vrs: list[int], values: list[Any]) -> None:
        """Set inputs or parameters, all or none; outputs follow when they are next asked for."""
        access = self._boolean_writes.get(tuple(vrs)) or self._writable(vrs, bool)
        self._store(vrs, values, access)

    def set_integer(self, vrs: list[int], values: list[Any]) -> None:
        """There are no integers."""
        self._none_of("Integer", vrs)

    def set_string(self, vrs: list[int], values: list[Any]) -> None:
        """There are no strings."""
        self._none_of("String", vrs)

    def _store(self, vrs: list[int], values: list[Any], access: Access) -> None:
        if access.where:
            self._values[access.where] = values
        else:
            for vr, value in zip(vrs, values, strict=True):
                self._values[vr] = value
        if access.parameters:
            self._params = None
        self._inputs = None

    # State

    def _get_fmu_state(self) -> Snapshot:
        before, after = self._values[: self._first_output], self._values[self._first_parameter :]
        return Snapshot(self._phase, self._time, (*before, *after), self._state)

    @_reported
    def _set_fmu_state(self, snapshot: Any) -> None:
        self._check_state(snapshot)
        self._values[: self._first_output] = snapshot.settable[: self._first_output]
        self._values[self._first_parameter :] = snapshot.settable[self._first_output :]
        self._time, self._state = snapshot.time, snapshot.state
        self._params = self._inputs = None
        self._enter(snapshot.phase)

    @_reported
    def state_to_bytes(self, snapshot: Any) -> bytes:
        """A state of this FMU, serialised."""
        self._check_state(snapshot)
        return to_bytes(snapshot, self._content)

    @_reported
    def state_from_bytes(self, data: bytes) -> Snapshot:
        """A state of this FMU from its bytes."""
        try:
            return from_bytes(data, self._content, like=self._get_fmu_state())
        except ValueError as error:
            raise RefusalError(str(error)) from error

    @property
    def _content(self) -> str:
        return type(self).__module__.rpartition("_")[2]

    # Checks

    def _require(self, call: str, phase: int) -> None:
        if self._phase != phase:
            raise RefusalError(f"{call} {PHASES[self._phase]}: must be {PHASES[phase]}")

    def _check_state(self, snapshot: Any) -> None:
        if not isinstance(snapshot, Snapshot):
            raise RefusalError(f"state of another FMU: must be of this one, {self._content}")

    def _check_step(self, current_time: float, step_size: float) -> None:
        self._require("fmi2DoStep", STEPPING)
        if not 0.0 < step_size < inf:
            raise RefusalError(f"step size = {step_size} s: must be a finite number above 0")
        if not isclose(current_time, self._time, rel_tol=1e-12, abs_tol=TIME_TOLERANCE):
            raise RefusalError(f"step from {current_time} s: must be from {self._time} s")

    def _readable(self, vrs: list[int], kind: type[Any]) -> Access:
        """How to read these variables; RefusalError where there are no such ones."""
        self._check_references(vrs, kind)
        return self._kept(self._boolean_reads if kind is bool else self._real_reads, vrs)

    def _writable(self, vrs: list[int], kind: type[Any]) -> Access:
        """How to write these variables; RefusalError where that is not allowed now."""
        self._check_references(vrs, kind)
        for vr in vrs:
            f, name = self._names[vr]
            if f.causality == "output":
                raise RefusalError(f"{name}: output set: must be an input or a parameter")
            if self._phase == TERMINATED:
                raise RefusalError(f"{name}: set after fmi2Terminate: must be before")
            if self._phase == STEPPING and f.causality == "parameter" and not f.tunable:
                raise RefusalError(
                    f"{name}: fixed parameter set in step mode: must be before "
                    "fmi2ExitInitializationMode"
                )
        return self._kept(self._boolean_writes if kind is bool else self._real_writes, vrs)

    def _kept(self, accesses: Accesses, vrs: list[int]) -> Access:
        first = vrs[0] if vrs else 0
        stop = first + len(vrs)
        fields = [self._names[vr][0] for vr in vrs]
        access = Access(
            list(vrs),
            slice(first, stop) if vrs == list(range(first, stop)) else None,
            any(f.causality == "output" for f in fields),
            any(f.causality == "parameter" for f in fields),
            any(f.limits for f in fields),
        )
        if len(accesses) == MOST_ACCESSES:
            accesses.clear()
        accesses[tuple(vrs)] = access
        return access

    def _check_references(self, vrs: list[int], kind: type[Any]) -> None:
        for vr in vrs:
            if not 0 <= vr < len(self._names):
                last = len(self._names) - 1
                raise RefusalError(f"value reference {vr}: must be from 0 to {last}")
            f, name = self._names[vr]
            if f.kind is not kind:
                wrong, right = _TYPES[kind], _TYPES[f.kind]
                raise RefusalError(f"{name}: accessed as {wrong}: must be as {right}")

    def _check_values(self, vrs: list[int], values: list[float]) -> None:
        for vr, value in zip(vrs, values, strict=True):
            f, name = self._names[vr]
            low, high = f.limits or (-inf, inf)
            if not (low <= value <= high and isfinite(value)):
                allowed = f"from {low:g} to {high:g} {f.unit}" if f.limits else "a finite number"
                raise RefusalError(f"{name} = {value!r} {f.unit}: must be {allowed}")

    def _not_finite(self, values: list[float]) -> str:
        """Which outputs are not finite."""
        names = self._names[self._outputs]
        return ", ".join(
            f"{name} = {value!r} {f.unit}"
            for (f, name), value in zip(names, values, strict=True)
            if not isfinite(value)
        )

    @_reported
    def _none_of(self, kind: str, vrs: list[int]) -> list[Any]:
        if vrs:
            raise RefusalError(f"value reference {vrs[0]}: there is no {kind} variable")
        return []

    # Reports

    def _discard(self, step_size: float, text: str) -> bool:
        self._inputs = None
        self._log(DISCARD, f"step of {step_size} s: {text}: must be finite")
        return False

    def _reported(self, error: BaseException) -> LoggedError:
        """Log an exception that would leave the slave; what leaves it instead."""
        self._inputs = None  # the outputs may not have been worked out
        if isinstance(error, RefusalError):
            self._log(ERROR, str(error))
        else:
            from traceback import format_exception  # only a bug in a block needs it

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

    # The block

    def _refresh(self) -> None:
        """Work out the outputs; before the end of initialisation the initial state as well."""
        self._read()
        if self._phase < STEPPING:
            self._state = self.block.initial_state(self._params, self._inputs)
        _, evaluate, _, unpack = self._functions
        values = unpack(evaluate(self._params, self._state, self._inputs))
        if not isfinite(sum(values)) and (text := self._not_finite(values)):
            raise RefusalError(f"{text}: must be finite")
        self._values[self._outputs] = values

    def _read(self) -> None:
        """Params and Inputs from the list of values."""
        if self._params is None:
            self._read_params()
        _, _, pack, _ = self._functions
        self._inputs = pack(self._values)

    def _read_params(self) -> Any:
        try:
            self._params = build_params(self.block, self._fields, self._values)
        except ValueError as error:
            raise RefusalError(str(error)) from error
        return self._params
