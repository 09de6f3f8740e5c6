"""An instance of a component that is Python code: the function that is called at each point.

Its outputs are those of its inputs at the start, too, however often these are passed on in the
initialisation: it then begins again each time.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from math import isfinite
from pathlib import Path
from traceback import extract_tb
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import InputError, SimulationError, nearest
from ..interface.fmi_types import Value
from ..interface.variables import Variable
from ..system.python_code import PythonCode
from .instance import ERROR, OK, Inputs

PLAIN = {"Real": float, "Integer": int, "Boolean": bool}
"""The type of a value by the kind of its variable."""


class CodeInstance:
    """One instance of Python code, in the life of an Instance."""

    def __init__(self, name: str, code: PythonCode) -> None:
        """InputError where it cannot be made."""
        self.name = name
        self.interface = code.interface
        self._code = code
        self._input_record = Inputs()
        self.reset()

    def reset(self) -> None:
        self._input_record.forget()
        self._parameters = {v.name: PLAIN[v.kind](v.start_value) for v in self._of("parameter")}
        self._inputs = {v.name: PLAIN[v.kind](v.start_value or 0) for v in self._of("input")}
        self._outputs: dict[str, Value] = {}
        self._time = 0.0
        self._at_start, self._changed = True, True
        self._error: BaseException | None = None
        self._begin()

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        self._time = start
        for name, value in values.items():
            self._assign(self.interface.by_name[name], value)

    def exit_initialization(self) -> None:
        self._settle()
        self._input_record.running = True

    def enter_step_mode(self) -> None:
        """It has no events."""

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        self._settle()
        return self._values(variables)

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        for variable, value in zip(variables, values, strict=True):
            self._input_record.set(variable, value)
            self._assign(variable, value)

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        if action == "get":

            def fetch() -> int:
                data[:] = self._values(variables)
                return OK

            return Call(fetch)
        self._input_record.bind(variables, data)

        def put() -> int:
            for variable, value in zip(variables, data.tolist(), strict=True):
                self._assign(variable, value)
            return OK

        return Call(put)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        def advance() -> int:
            self._at_start = False
            self._time = float(clock[2])
            try:
                self._call()
            except BaseException as error:  # it must not get into the compiled loop
                self._error = error
                return ERROR
            return OK

        return Call(advance)

    def through_events(self, status: int, begin: float, end: float) -> tuple[int, float]:
        """It has no events."""
        return status, end

    def saved(self) -> Any:
        state = self._step, self._parameters, self._inputs, self._outputs
        try:
            return (
                deepcopy(state),
                self._time,
                self._at_start,
                self._changed,
                self._input_record.saved(),
            )
        except Exception as error:  # of any object that the user's has
            raise InputError(
                f"{self.name}: its state cannot be copied: {error_in_words(error)}"
            ) from error

    def restore(self, saved: Any) -> None:
        state, self._time, self._at_start, self._changed, inputs = saved
        self._step, self._parameters, self._inputs, self._outputs = deepcopy(state)
        self._input_record.restore(inputs)

    def numbers(self) -> npt.NDArray[np.float64]:
        raise InputError(
            f"{self.name}: is Python code, whose state is not known as numbers; must be an FMU"
        )

    def take_numbers(self, numbers: npt.NDArray[np.float64]) -> bool:
        """As numbers(), which raises before."""
        self.numbers()
        return False

    def last_successful_time(self) -> float | None:
        return None

    def the_end(self) -> float | None:
        return None

    def failure(self, status: int, time: float) -> SimulationError:
        error = self._error or SimulationError(f"status {status}")
        if not isinstance(error, Exception):  # Ctrl-C, or sys.exit()
            raise error
        text = f"{self.name}: {error_in_words(error)} at t = {self._time:.9g} s{self._input_record}"
        failed = SimulationError(text)
        failed.__cause__ = error
        return failed

    def remarks(self, returned: int = 0, first: float = 0.0) -> list[str]:
        return []

    def quieten(self) -> None:
        """It has no log."""

    def close(self) -> None:
        """Nothing of it is to be freed."""

    def _values(self, variables: Sequence[Variable]) -> list[Value]:
        """What they have now."""
        value_of = {**self._parameters, **self._inputs, **self._outputs}
        return [value_of.get(v.name, v.start_value) for v in variables]  # type: ignore[misc]

    def _of(self, causality: str) -> list[Variable]:
        return self.interface.of(causality)

    def _begin(self) -> None:
        """As at the start of a run, with the parameters as they are."""
        try:
            self._step = self._code.new()
        except Exception as error:  # of the user's class
            raise InputError(f"{self.name}: cannot be made: {error_in_words(error)}") from error
        for name, value in self._parameters.items():
            self._put(name, value)

    def _assign(self, variable: Variable, value: Value) -> None:
        """Note the value of an input, or pass that of a parameter on."""
        typed = PLAIN[variable.kind](value)
        self._changed = True
        if variable.causality == "parameter":
            self._parameters[variable.name] = typed
            self._put(variable.name, typed)
        else:
            self._inputs[variable.name] = typed

    def _put(self, name: str, value: Value) -> None:
        """A parameter is an attribute of the object."""
        setattr(getattr(self._step, "__self__", self._step), name, value)

    def _settle(self) -> None:
        """Before the first step, work out the outputs that belong to the inputs of now."""
        if not (self._at_start and self._changed):
            return
        self._begin()
        try:
            self._call()
        except Exception as error:
            self._error = error
            raise self.failure(ERROR, self._time) from error
        self._changed = False

    def _call(self) -> None:
        """Call the function, and take the outputs; InputError where these are wrong."""
        answer, outputs = self._step(self._time, dict(self._inputs)), self._of("output")
        if isinstance(answer, Mapping):
            returned = answer
        elif answer is None:
            returned = {}
        else:
            returned = {v.name: answer for v in outputs[:1]}
        names = [v.name for v in outputs]
        unknown = next((name for name in returned if name not in names), None)
        if unknown:
            raise InputError(f"returned {unknown!r}, which is no output; {nearest(unknown, names)}")
        for v in outputs:
            if v.name not in returned:
                raise InputError(f"returned no {v.name!r}; must return a value of each output")
            try:
                value = PLAIN[v.kind](returned[v.name])
            except (TypeError, ValueError) as error:
                raise InputError(
                    f"returned {v.name} = {returned[v.name]!r}; must be a number"
                ) from error
            if not isfinite(value):
                raise InputError(f"returned {v.name} = {value!r}; must be finite")
            self._outputs[v.name] = value


def error_in_words(error: BaseException) -> str:
    """An error of the user's code in a line: its file and line, what it is, and what it says."""
    if isinstance(error, InputError | SimulationError):
        return str(error)
    *_, last = extract_tb(error.__traceback__)
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return f"{Path(last.filename).name}, line {last.lineno}: {text}"
