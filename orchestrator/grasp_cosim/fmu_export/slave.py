"""Runs a block behind the FMI 2.0 interface of pythonfmu 0.7.0, whose binary is as it comes.

A call that is refused raises and has no effect; pythonfmu answers fmi2Fatal, and logs the reason.
A ValueError, ArithmeticError or ImportError is a reason; of any other exception the whole traceback
is logged. Value references are positions in one list of values. Outputs are worked out when they
are asked for.
"""

import atexit
import ctypes
import os
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from math import inf, isclose, isfinite
from operator import itemgetter
from typing import Any, NamedTuple, NoReturn, TypeVar, cast
from weakref import ref

from . import contract
from .contract import TYPES, Scalar, Variable

INSTANTIATED, INITIALISING, STEPPING, TERMINATED = range(4)
PHASES = "before initialisation", "in initialisation mode", "in step mode", "after fmi2Terminate"

TIME_TOLERANCE = 1e-9
"""How far, in s, the host's clock may be from the slave's; relative to the time it is 1e-12."""

MAGIC = b"graspFMU"
HEAD = 24
"""Bytes of a state before its numbers: the magic, and the content hash of the FMU."""

REASONS = (ValueError, ArithmeticError, ImportError)


class Snapshot(NamedTuple):
    """The state of a slave at a moment: everything else follows from it."""

    phase: int
    time: float
    settable: tuple[Any, ...]
    """The values of inputs and parameters."""
    state: Any
    """The state of the block."""


@cache
def _shape(block: contract.Block) -> tuple[list[contract.Field], list[Variable], tuple[Any, ...]]:
    """What all instances share, as it takes longer to make than all the rest of one: fields,
    variables, and the functions to step, give outputs, pack inputs, check them (None where the
    block has none) and unpack outputs.
    """
    fields = contract.declared(block)
    pack, unpack = contract.packer(block.Inputs, fields), contract.unpacker(fields)
    step = contract.stepper(block, fields)
    functions = step, block.outputs, pack, contract.input_check(block), unpack
    return fields, contract.variables(fields), functions


_Read = tuple[list[int], bool, slice | None, Callable[[list[Any]], Any]]
"""References, whether outputs are among them, where they are if in a row, what picks their values.
"""

_Set = tuple[list[int], slice | None]
"""References of inputs, and where they are if in a row."""

_F = TypeVar("_F", bound=Callable[..., Any])


def reported(call: _F) -> _F:
    """The call, with what it raises reported. The calls of a step report it themselves, as a
    wrapper would take time.
    """

    def reporting(self: "Slave", *arguments: Any) -> Any:
        try:
            return call(self, *arguments)
        except BaseException as error:
            self._report(error)

    return cast(_F, reporting)


def _row(vrs: list[int]) -> slice | None:
    """Where references are that are in a row, as those of a host mostly are; else None."""
    row = slice(vrs[0], vrs[-1] + 1) if vrs else slice(0, 0)
    return row if vrs == [*range(row.start, row.stop)] else None


def _getter(kind: type[Scalar]) -> Callable[["Slave", list[int]], list[Any]]:
    def get(self: "Slave", vrs: list[int]) -> list[Any]:
        """Values of the given references."""
        try:
            known, of_outputs, row, picked = self._last_read[kind]
            if vrs != known:
                _, of_outputs, row, picked = self._reading(vrs, kind)
            if of_outputs and self._inputs is None:
                self._refresh()
            return self._values[row] if row else [*picked(self._values)]
        except BaseException as error:
            self._report(error)

    return get


def _setter(kind: type[Scalar]) -> Callable[["Slave", list[int], list[Any]], None]:
    real = kind is float

    def set_(self: "Slave", vrs: list[int], values: list[Any]) -> None:
        """Set inputs or parameters, all or none; outputs follow when they are next asked for."""
        try:
            known, row = self._last_set[kind]
            if vrs != known:
                row = self._row_to_set(vrs, kind, values)
            elif real and not isfinite(sum(values)):
                self._check_values(vrs, values)
            if row:
                self._values[row] = values
            else:
                for vr, value in zip(vrs, values, strict=True):
                    self._values[vr] = value
            self._inputs = None
        except BaseException as error:
            self._report(error)

    return set_


class Slave:
    """An instance of a block, as pythonfmu calls it."""

    @reported
    def __init__(self, maker: "Maker", name: str) -> None:
        self.maker, self.name, self._block = maker, name, maker.block
        self._time = 0.0
        self._params: Any = None  # None: one was set and they are to be read again
        self._inputs: Any = None  # None: something was set and the outputs are out of date
        self._fields, self._variables, self._functions = _shape(self._block)
        causalities = [v.causality for v in self._variables]
        first, number = causalities.count("input"), causalities.count("output")
        self._first_parameter = first + number
        self._outputs = slice(first, self._first_parameter)
        self._output_vrs = frozenset(range(first, self._first_parameter))
        self._settable = [vr for vr, _ in enumerate(causalities) if vr not in self._output_vrs]
        self._longest_step = min(contract.longest_step(self._block), sys.float_info.max)
        self._values = [v.start for v in self._variables]
        self._state = self._block.initial_state(self._block.Params(), self._block.Inputs())
        self._enter(INSTANTIATED)

    def _enter(self, phase: int) -> None:
        self._phase = phase
        # The host nearly always asks for the same again, and sets the same inputs
        nothing_read: _Read = [], False, slice(0, 0), tuple
        nothing_set: _Set = [], slice(0, 0)
        self._last_read = dict.fromkeys(TYPES, nothing_read)
        self._last_set = dict.fromkeys(TYPES, nothing_set)

    # The life cycle

    @reported
    def setup_experiment(self, start_time: float, *_: object) -> None:
        """Time starts at start_time, in s."""
        self._require("fmi2SetupExperiment", INSTANTIATED)
        if not isfinite(start_time):
            raise ValueError(f"start time = {start_time} s: must be a finite number")
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

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the block by step_size seconds with the inputs as they are.

        Where it cannot, it raises: to discard a step is for pythonfmu to end the simulation.
        """
        try:
            if not (
                self._phase == STEPPING
                and 0.0 < step_size <= self._longest_step
                and abs(current_time - self._time) <= TIME_TOLERANCE
            ):
                self._check_step(current_time, step_size)
            step, _, pack, check, _ = self._functions
            params, inputs = self._params, self._inputs
            if params is None:
                params = self._read_params()
            if inputs is None:
                inputs = self._inputs = pack(self._values)
                if check:
                    check(params, inputs)
            try:
                state, values, total = step(params, self._state, inputs, step_size)
                if not isfinite(total):
                    self._check_finite(values)
            except REASONS as error:
                raise ArithmeticError(f"step of {step_size} s: {error}") from error
            self._state = state
            self._values[self._outputs] = values
            self._time = current_time + step_size
            return True
        except BaseException as error:
            self._report(error)

    # Values

    get_real, set_real = _getter(float), _setter(float)
    get_boolean, set_boolean = _getter(bool), _setter(bool)
    get_integer, set_integer = _getter(int), _setter(int)
    get_string, set_string = _getter(str), _setter(str)

    # Checks

    def _check_kind(self, vrs: list[int], kind: type[Scalar]) -> None:
        for vr in vrs:
            if not 0 <= vr < len(self._variables):
                last = len(self._variables) - 1
                raise ValueError(f"value reference {vr}: must be from 0 to {last}")
            v = self._variables[vr]
            if v.kind is not kind:
                wrong, right = TYPES[kind], TYPES[v.kind]
                raise ValueError(f"{v.name}: accessed as {wrong}: must be as {right}")

    def _require(self, call: str, phase: int) -> None:
        if self._phase != phase:
            raise ValueError(f"{call} {PHASES[self._phase]}: must be {PHASES[phase]}")

    def _check_step(self, current_time: float, step_size: float) -> None:
        self._require("fmi2DoStep", STEPPING)
        if not 0.0 < step_size < inf:
            raise ValueError(f"step size = {step_size} s: must be a finite number above 0")
        late = abs(current_time - self._time)
        if not (late <= TIME_TOLERANCE or isclose(current_time, self._time, rel_tol=1e-12)):
            raise ValueError(f"step from {current_time} s: must be from {self._time} s")
        if step_size > self._longest_step:
            raise ValueError(f"step of {step_size} s: must be at most {self._longest_step:g} s")

    def _check_settable(self, vrs: list[int]) -> None:
        for v in (self._variables[vr] for vr in vrs):
            if v.causality == "output":
                raise ValueError(f"{v.name}: output set: must be an input or a parameter")
            if self._phase == TERMINATED:
                raise ValueError(f"{v.name}: set after fmi2Terminate: must be before")
            if self._phase == STEPPING and v.variability == "fixed":
                must = "must be before fmi2ExitInitializationMode"
                raise ValueError(f"{v.name}: fixed parameter set in step mode: {must}")

    def _reading(self, vrs: list[int], kind: type[Scalar]) -> _Read:
        """Check what is to be read, and return how."""
        self._check_kind(vrs, kind)
        of_outputs = not self._output_vrs.isdisjoint(vrs)
        reading = [*vrs], of_outputs, _row(vrs), itemgetter(*(vrs or [0]))
        self._last_read[kind] = reading
        return reading

    def _row_to_set(self, vrs: list[int], kind: type[Scalar], values: list[Any]) -> slice | None:
        """Check all that is to be set; where it goes, None if that is not in a row."""
        self._check_kind(vrs, kind)
        self._check_settable(vrs)
        self._check_values(vrs, values)
        row = _row(vrs)
        if max(vrs, default=0) < self._first_parameter:
            self._last_set[kind] = [*vrs], row
        else:
            self._params = None
        return row

    def _check_values(self, vrs: list[int], values: list[Any]) -> None:
        for vr, value in zip(vrs, values, strict=True):
            self._variables[vr].check(value)

    def _check_finite(self, values: list[float]) -> None:
        pairs = zip(self._variables[self._outputs], values, strict=True)
        wrong = [f"{v.name} = {x!r}{v.in_unit}" for v, x in pairs if not isfinite(x)]
        if wrong:
            raise ValueError(f"{', '.join(wrong)}: must be finite")

    # The block

    def _refresh(self) -> None:
        """Work out the outputs; before the end of initialisation the initial state too."""
        _, outputs, pack, check, unpack = self._functions
        params = self._read_params()
        self._inputs = inputs = pack(self._values)
        if check:
            check(params, inputs)
        if self._phase < STEPPING:
            self._state = self._block.initial_state(params, inputs)
        values = unpack(outputs(params, self._state, inputs))
        self._check_finite(values)
        self._values[self._outputs] = values

    def _read_params(self) -> Any:
        if self._params is None:
            self._params = contract.build_params(self._block, self._fields, self._values)
        return self._params

    # States

    def _get_fmu_state(self) -> Snapshot:
        settable = tuple(self._values[vr] for vr in self._settable)
        return Snapshot(self._phase, self._time, settable, self._state)

    @reported
    def _set_fmu_state(self, snapshot: object) -> None:
        phase, self._time, settable, self._state = self._own_snapshot(snapshot)
        for vr, value in zip(self._settable, settable, strict=True):
            self._values[vr] = value
        self._params = self._inputs = None
        self._enter(phase)

    @reported
    def state_to_bytes(self, snapshot: object) -> bytes:
        """A state of this FMU, serialised: Saved states in fmus/README.md."""
        numbers = [*_scalars(self._own_snapshot(snapshot))]
        head = MAGIC + self.maker.content.encode()
        return head + struct.pack(f"<{len(numbers)}d", *numbers)

    @reported
    def state_from_bytes(self, data: bytes) -> Snapshot:
        """A state of this FMU from its bytes."""
        like, content = self._get_fmu_state(), self.maker.content
        size = HEAD + 8 * len(list(_scalars(like)))
        if data[:HEAD] != MAGIC + content.encode():
            raise ValueError(f"state of another FMU: must be of this one, {content}")
        if len(data) != size:
            raise ValueError(f"state of {len(data)} bytes: must have {size}")
        snapshot: Snapshot = _shaped(like, iter(struct.unpack(f"<{size // 8 - 3}d", data[HEAD:])))
        if snapshot.phase not in range(len(PHASES)) or not isfinite(snapshot.time):
            raise ValueError(
                f"state in phase {snapshot.phase} at {snapshot.time} s: must be of a run"
            )
        for vr, value in zip(self._settable, snapshot.settable, strict=True):
            self._variables[vr].check(value)
        return snapshot

    def _own_snapshot(self, snapshot: object) -> Snapshot:
        if not isinstance(snapshot, Snapshot):
            raise ValueError(f"state of another FMU: must be of this one, {self.maker.content}")
        return snapshot

    # pythonfmu's side

    def _get_log_queue(self) -> list[Any]:
        return _NO_MESSAGES

    def _report(self, error: BaseException) -> NoReturn:
        """Raise what pythonfmu is to log of an exception that would leave the slave.

        The fault upstream: `handle_py_exception` in PySlaveInstance.cpp calls `cleanPyObject`. That
        gives up the references to class, instance and messages, for an instance that lives on. The
        pointers stay as they are, so the next call uses what may have been freed, and the
        destructor gives the references up once more. It shows as a host that crashes some calls
        after the first one that was refused. The function is in 0.5.0 and in 0.7.0, the newest.

        So one reference is added for each that is given up. This may go with the first version that
        gives up none: tests/fmus/test_pythonfmu.py fails then.
        """
        for used in (self.maker, self, _NO_MESSAGES):
            keep(used)
        self._inputs = None  # the outputs may not have been worked out
        if isinstance(error, REASONS):
            text = str(error)
        else:
            from traceback import format_exception  # only a bug needs it

            text = "".join(format_exception(error)).strip()
        raise ReportedError(f"{self.name}, t = {self._time:.9g} s: {text}") from None


class ReportedError(Exception):
    """What leaves the slave: pythonfmu logs its repr, as a format of printf."""

    def __init__(self, text: str) -> None:
        super().__init__(text.replace("%", "%%").encode(errors="replace").decode())

    __repr__ = Exception.__str__


_NO_MESSAGES: list[Any] = []
"""What a slave has for pythonfmu's log. It would be passed on while the exception is set that a
call raised: a logger in Python cannot run then.
"""


class Maker:
    """Stands for the class that pythonfmu looks for: it makes instances, one alive at a time.

    pythonfmu asks the class, not the instance, to serialise a state.
    """

    def __init__(self, block: Any, script: str) -> None:
        self.block = block
        self.name, _, self.content = script.rpartition("_")

    def __call__(self, instance_name: str, resources: str, **_: object) -> Slave:
        """Make an instance, at instantiation and at every reset.

        pythonfmu puts the FMU's folder on the import path, and leaves it there; all modules have
        been imported by now.
        """
        with suppress(ValueError):
            sys.path.remove(resources)
        sys.path_importer_cache.pop(resources, None)
        _binaries.add(os.path.normpath(f"{resources}/../binaries/linux64/{self.name}.so"))
        slave = Slave(self, instance_name)
        self._made = ref(slave)
        return slave

    def _fmu_state_to_bytes(self, snapshot: object) -> bytes:
        return cast(Slave, self._made()).state_to_bytes(snapshot)

    def _fmu_state_from_bytes(self, data: bytes) -> Snapshot:
        return cast(Slave, self._made()).state_from_bytes(data)


def offer(block: Any, module: dict[str, Any]) -> None:
    """Called by the script of an FMU: have pythonfmu find a Maker in the names of its module.

    Two faults upstream are in `findClass` in PySlaveInstance.cpp. It imports the script, runs it
    again at every instantiation, and looks at the bases of all classes that this makes. It is in
    0.6.4 to 0.7.0, the newest, and not in 0.6.3.

    - It gives up a reference to the names of the module, which it only borrowed from
      `PyModule_GetDict`. It shows as a crash at some later instantiation, when the names are freed.
      So one reference is added each time. This may go with the first version that gives up none:
      tests/fmus/test_pythonfmu.py fails then.
    - It never gives up the lists and texts that it makes of the bases: a host that instantiates
      often grows. Here the script makes no class, so it takes what the module has under the empty
      name.
    """
    keep(module)
    module[""] = Maker(block, module["__name__"])


_binaries: set[str] = set()
"""The paths of those that have made an instance, as hosts name them when they load them.

The files may be gone at the end; the system then knows a library that is loaded by its name only.
"""


@atexit.register
def let_go() -> None:
    """Have pythonfmu's binaries let go of Python while they can.

    The fault upstream: The destructor of the library calls `finalizePythonInterpreter` in
    PySlaveInstance.cpp. It sets a static `shared_ptr` that may have been destroyed by then, as the
    process ends. It shows as a crash at the end of a host that did not unload the FMU. The function
    is in 0.6.4 to 0.7.0, the newest, and not in 0.6.3. To find out whether this may go with a later
    version, have this function do nothing, and run tests/fmus/test_hard_times.py.
    """
    for binary in _binaries:
        if hasattr(os, "RTLD_NOLOAD"):  # on Windows there is no need
            with suppress(OSError, AttributeError):  # it was unloaded
                ctypes.PyDLL(binary, mode=os.RTLD_NOLOAD).finalizePythonInterpreter()


def keep(used: object) -> None:
    """Add the reference to an object that pythonfmu gives up without owning it."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(used))


def _scalars(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for item in value:
            yield from _scalars(item)
    else:
        yield value


def _shaped(like: Any, numbers: Iterator[float]) -> Any:
    """The numbers in the shape of `like`, each of the type that it has there."""
    if isinstance(like, tuple):
        items = [_shaped(item, numbers) for item in like]
        return tuple(items) if type(like) is tuple else type(like)(*items)
    number = next(numbers)
    if type(like) is not float and type(like)(number) != number:
        raise ValueError(f"state with {number!r}: must be a {type(like).__name__} there")
    return type(like)(number)
