"""CVode of SUNDIALS, as FMPy ships it, one of its steps at a time.

FMPy's class for it integrates whole intervals, and beyond their ends. Here no evaluation is beyond
the time that a step is told to stop at, where an input may jump.
"""

from collections.abc import Callable, Sequence
from ctypes import CFUNCTYPE, byref, c_char_p, c_double, c_int, c_int64, c_void_p
from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.sundials import libraries

from ..system.parts import Solver

Function = Callable[[float, int, int], int]
"""Evaluates at a time and states, which are at an address, and puts the values at another one.

Returns 0, less where that failed, or more where it might not fail for a shorter step.
"""

_BDF, _ONE_STEP, _ROOT_RETURN = 2, 2, 2
_EVALUATION = CFUNCTYPE(c_int, c_double, c_void_p, c_void_p, c_void_p)
_ERROR_HANDLER = CFUNCTYPE(None, c_int, c_char_p, c_char_p, c_char_p, c_int, c_void_p, c_void_p)
_CORE, _CVODE = libraries.sundials_core, libraries.sundials_cvode


def _bound(library: Any, name: str, kinds: Sequence[Any], result: Any = c_void_p) -> Any:
    return CFUNCTYPE(result, *kinds)((name, library))


_new_vector = _bound(libraries.sundials_nvecserial, "N_VNew_Serial", [c_int64, c_void_p])
_data_of = _bound(_CORE, "N_VGetArrayPointer", [c_void_p])
_new_matrix = _bound(
    libraries.sundials_sunmatrixdense, "SUNDenseMatrix", [c_int64, c_int64, c_void_p]
)
_new_linear = _bound(libraries.sundials_sunlinsoldense, "SUNLinSol_Dense", [c_void_p] * 3)
_create = _bound(_CVODE, "CVodeCreate", [c_int, c_void_p])
_set_stop = _bound(_CVODE, "CVodeSetStopTime", [c_void_p, c_double], c_int)
_step = _bound(_CVODE, "CVode", [c_void_p, c_double, c_void_p, c_void_p, c_int], c_int)


def _call(library: Any, name: str, *arguments: Any) -> None:
    """Call a function that returns a status; by its name, as FMPy's of that name has types."""
    _check(library[name](*arguments))


class CvodeError(Exception):
    """CVode could not go on; the text is its own."""


class Cvode:
    """Integrates x' = f(t, x) by backward differentiation, and finds the zeros of g(t, x)."""

    def __init__(
        self, states: int, indicators: int, slopes: Function, crossings: Function, options: Solver
    ) -> None:
        """Slopes are f, crossings g; restart() before the first step."""
        self._options = options
        self._error: BaseException | None = None
        self._message = ""
        self._context = context = c_void_p()
        _call(_CORE, "SUNContext_Create", 0, byref(context))
        self._x, self._absolute_tolerances = (
            c_void_p(_new_vector(states, context)) for _ in range(2)
        )
        self.x: npt.NDArray[np.float64] = _view(self._x, states)
        """The states now."""
        self._matrix = c_void_p(_new_matrix(states, states, context))
        self._linear = c_void_p(_new_linear(self._x, self._matrix, context))
        self._memory = memory = c_void_p(_create(_BDF, context))
        self._evaluations = (
            _EVALUATION(self._guarded(slopes)),
            _EVALUATION(self._guarded(crossings, True)),
        )
        self._error_handler = _ERROR_HANDLER(self._hear)
        _call(_CORE, "SUNContext_ClearErrHandlers", context)
        _call(_CORE, "SUNContext_PushErrHandler", context, self._error_handler, None)
        self.x[:] = 0.0
        _call(_CVODE, "CVodeInit", memory, self._evaluations[0], c_double(0.0), self._x)
        self._tolerate(np.ones(states))
        if indicators:
            _call(_CVODE, "CVodeRootInit", memory, indicators, self._evaluations[1])
        _call(_CVODE, "CVodeSetLinearSolver", memory, self._linear, self._matrix)
        _call(_CVODE, "CVodeSetMaxStep", memory, c_double(options.maximum_step or 0.0))
        _call(_CVODE, "CVodeSetNoInactiveRootWarn", memory)

    def restart(self, time: float, nominals: npt.NDArray[np.float64] | None = None) -> None:
        """Begin again at a time, in s, with the states in x; with nominals where these are new."""
        if nominals is not None:
            self._tolerate(nominals)
        _call(_CVODE, "CVodeReInit", self._memory, c_double(time), self._x)

    def step(self, stop: float) -> tuple[float, bool]:
        """Go on by one step, at most to `stop`, in s; the time, and if an indicator changed there.

        CvodeError where that is not possible; an error of a function as it was raised.
        """
        reached = c_double()
        _check(_set_stop(self._memory, stop))
        flag = _step(self._memory, stop, self._x, byref(reached), _ONE_STEP)
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        if flag < 0:
            raise CvodeError(self._message or f"CVode returned {flag}")
        return reached.value, flag == _ROOT_RETURN

    def close(self) -> None:
        """Free all of it."""
        _CVODE["CVodeFree"](byref(self._memory))
        _CORE["SUNLinSolFree"](self._linear)
        _CORE["SUNMatDestroy"](self._matrix)
        for vector in (self._x, self._absolute_tolerances):
            _CORE["N_VDestroy"](vector)
        _CORE["SUNContext_Free"](byref(self._context))
        del self._evaluations, self._error_handler  # they refer to this

    def _tolerate(self, nominals: npt.NDArray[np.float64]) -> None:
        relative, absolute = self._options.relative_tolerance, self._options.absolute_tolerance
        if absolute is None:
            absolute = relative / 100.0
        _view(self._absolute_tolerances, len(nominals))[:] = absolute * nominals
        _call(
            _CVODE, "CVodeSVtolerances", self._memory, c_double(relative), self._absolute_tolerances
        )

    def _guarded(self, function: Function, roots: bool = False) -> Callable[..., int]:
        """For CVode: what it raises waits until CVode has returned."""

        def evaluate(time: float, states: int, values: int, _: Any) -> int:
            try:
                return function(time, _data_of(states), values if roots else _data_of(values))
            except BaseException as error:
                self._error = error
                return -1

        return evaluate

    def _hear(self, _line: int, _of: bytes, _file: bytes, text: bytes, *_: Any) -> None:
        self._message = " ".join((text or b"").decode(errors="replace").split())


def _view(vector: c_void_p, size: int) -> npt.NDArray[np.float64]:
    return np.ctypeslib.as_array((c_double * size).from_address(_data_of(vector)))


def _check(status: int) -> None:
    if status < 0:
        raise CvodeError(f"SUNDIALS returned {status}")
