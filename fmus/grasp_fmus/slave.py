"""The slave that runs a block; its outputs are worked out when they are asked for."""

from collections.abc import Callable
from functools import cache
from math import inf, isfinite
from typing import Any, ClassVar

from .base import INSTANTIATED, PHASES, STEPPING, TIME_TOLERANCE, RefusalError, Slave, reported
from .contract import (
    Block,
    Field,
    build_params,
    declared,
    longest_step,
    packer,
    unpacker,
    variables,
)
from .host_log import DISCARD
from .snapshot import Snapshot, from_bytes, to_bytes
from .variable import Variable


@cache
def _shape(
    block: Block,
) -> tuple[list[Field], list[Variable], float, tuple[Callable[..., Any], ...]]:
    """Made once for all instances: that takes longer than all the rest of one."""
    fields = declared(block)
    functions = (block.step, block.outputs, packer(block.Inputs, fields), unpacker(fields))
    return fields, variables(fields), longest_step(block), functions


class Fmi2Slave(Slave):
    """A block as an FMI 2.0 co-simulation slave; a subclass names the block."""

    block: Block
    requires: ClassVar[tuple[str, ...]] = ()
    """Packages that the block imports when its first state is made; not packed."""

    def _prepare(self) -> None:
        self._fields, self._variables, self._longest, self._functions = _shape(
            self.block  # type: ignore[arg-type]  # a module can be hashed
        )
        self._values = [v.start for v in self._variables]
        causalities = [v.causality for v in self._variables]
        self._first_output = causalities.count("input")
        self._first_parameter = self._first_output + causalities.count("output")
        self._outputs = slice(self._first_output, self._first_parameter)
        self._state = self._initial_state(self.block.Params(), self.block.Inputs())
        self._enter(INSTANTIATED)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance the block by step_size seconds with the inputs as they are.

        Returns False, and stays where it is, if the step is longer than the block takes, if the
        outputs would not be finite, or if the block gives a reason of its own: a plain
        ArithmeticError.
        """
        try:
            if not (
                self._phase == STEPPING
                and 0.0 < step_size < inf
                and -TIME_TOLERANCE <= current_time - self._time <= TIME_TOLERANCE
            ):
                self._check_step(current_time, step_size)
            if step_size > self._longest:
                return self._discard(step_size, f"must be at most {self._longest:g} s")
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
                own = type(error) is ArithmeticError
                fault = f"{type(error).__name__}: {error}: must be finite"
                return self._discard(step_size, str(error) if own else fault)
            if not isfinite(sum(values)) and (text := self._not_finite(values)):
                return self._discard(step_size, f"{text}: must be finite")
        except BaseException as error:
            raise self._reported(error) from None
        self._state = state
        self._values[self._outputs] = values
        self._time = current_time + step_size
        return True

    # State

    def _get_fmu_state(self) -> Snapshot:
        before, after = self._values[: self._first_output], self._values[self._first_parameter :]
        return Snapshot(self._phase, self._time, (*before, *after), self._state)

    @reported
    def _set_fmu_state(self, snapshot: Any) -> None:
        self._check_state(snapshot)
        self._values[: self._first_output] = snapshot.settable[: self._first_output]
        self._values[self._first_parameter :] = snapshot.settable[self._first_output :]
        self._time, self._state = snapshot.time, snapshot.state
        self._params = self._inputs = None
        self._enter(snapshot.phase)

    @reported
    def state_to_bytes(self, snapshot: Any) -> bytes:
        """A state of this FMU, serialised."""
        self._check_state(snapshot)
        return to_bytes(snapshot, self._content)

    @reported
    def state_from_bytes(self, data: bytes) -> Snapshot:
        """A state of this FMU from its bytes."""
        variables = (
            *self._variables[: self._first_output],
            *self._variables[self._first_parameter :],
        )
        try:
            snapshot = from_bytes(data, self._content, like=self._get_fmu_state())
            for v, value in zip(variables, snapshot.settable, strict=True):
                v.check(value)
        except (ValueError, OverflowError) as error:
            raise RefusalError(str(error)) from error
        if snapshot.phase not in range(len(PHASES)) or not isfinite(snapshot.time):
            raise RefusalError(f"state in phase {snapshot.phase} at {snapshot.time} s: is none")
        return snapshot

    @property
    def _content(self) -> str:
        return type(self).__module__.rpartition("_")[2]

    # Checks

    def _check_state(self, snapshot: Any) -> None:
        if not isinstance(snapshot, Snapshot):
            raise RefusalError(f"state of another FMU: must be of this one, {self._content}")

    def _not_finite(self, values: list[float]) -> str:
        return ", ".join(
            f"{v.name} = {value!r}{v.in_unit}"
            for v, value in zip(self._variables[self._outputs], values, strict=True)
            if not isfinite(value)
        )

    def _discard(self, step_size: float, text: str) -> bool:
        self._inputs = None
        self._log(DISCARD, f"step of {step_size} s: {text}")
        return False

    # The block

    def _refresh(self) -> None:
        """Work out the outputs; before the end of initialisation the initial state as well."""
        _, evaluate, pack, unpack = self._functions
        params = self._read_params() if self._params is None else self._params
        self._inputs = inputs = pack(self._values)
        if self._phase < STEPPING:
            self._state = self._initial_state(params, inputs)
        values = unpack(evaluate(params, self._state, inputs))
        if not isfinite(sum(values)) and (text := self._not_finite(values)):
            raise RefusalError(f"{text}: must be finite")
        self._values[self._outputs] = values

    def _initial_state(self, params: Any, inputs: Any) -> Any:
        try:
            return self.block.initial_state(params, inputs)
        except ImportError as error:
            raise RefusalError(str(error)) from error

    def _read_params(self) -> Any:
        try:
            self._params = build_params(self.block, self._fields, self._values)
        except ValueError as error:
            raise RefusalError(str(error)) from error
        return self._params
