"""CVode of SUNDIALS, as FMPy ships it, one step of its own at a time.

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
_PASSED = CFUNCTYPE(c_int, c_double, c_void_p, c_void_p, c_void_p)
_SAID = CFUNCTYPE(None, c_int, c_char_p, c_char_p, c_char_p, c_int, c_void_p, c_void_p)


def _bound(library: Any, name: str, kinds: Sequence[Any], result: Any = c_int) -> Any:
    return CFUNCTYPE(result, *kinds)((name, library))


def _of_cvode(name: str, *kinds: Any) -> Any:
    return _bound(libraries.sundials_cvode, name, [c_void_p, *kinds])


_core, _serial = libraries.sundials_core, libraries.sundials_nvecserial
_dense, _linear = libraries.sundials_sunmatrixdense, libraries.sundials_sunlinsoldense
_new_context = _bound(_core, "SUNContext_Create", [c_int, c_void_p])
_be_silent = _bound(_core, "SUNContext_ClearErrHandlers", [c_void_p])
_tell = _bound(_core, "SUNContext_PushErrHandler", [c_void_p, _SAID, c_void_p])
_free_context = _bound(_core, "SUNContext_Free", [c_void_p])
_new_vector = _bound(_serial, "N_VNew_Serial", [c_int64, c_void_p], c_void_p)
_data_of = _bound(_core, "N_VGetArrayPointer", [c_void_p], c_void_p)
_free_vector = _bound(_core, "N_VDestroy", [c_void_p], None)
_new_matrix = _bound(_dense, "SUNDenseMatrix", [c_int64, c_int64, c_void_p], c_void_p)
_free_matrix = _bound(_core, "SUNMatDestroy", [c_void_p], None)
_new_linear = _bound(_linear, "SUNLinSol_Dense", [c_void_p] * 3, c_void_p)
_free_linear = _bound(_core, "SUNLinSolFree", [c_void_p])
_create = _bound(libraries.sundials_cvode, "CVodeCreate", [c_int, c_void_p], c_void_p)
_init = _of_cvode("CVodeInit", _PASSED, c_double, c_void_p)
_init_again = _of_cvode("CVodeReInit", c_double, c_void_p)
_set_tolerances = _of_cvode("CVodeSVtolerances", c_double, c_void_p)
_set_roots = _of_cvode("CVodeRootInit", c_int, _PASSED)
_set_linear = _of_cvode("CVodeSetLinearSolver", c_void_p, c_void_p)
_set_longest = _of_cvode("CVodeSetMaxStep", c_double)
_set_stop = _of_cvode("CVodeSetStopTime", c_double)
_no_warning = _of_cvode("CVodeSetNoInactiveRootWarn")
_step = _of_cvode("CVode", c_double, c_void_p, c_void_p, c_int)
_free = _bound(libraries.sundials_cvode, "CVodeFree", [c_void_p], None)


class CvodeError(Exception):
    """CVode could not go on; the text is its own."""


class Cvode:
    """Integrates x' = f(t, x) by backward differentiation, and finds the zeros of g(t, x)."""

    def __init__(
        self, states: int, indicators: int, slopes: Function, crossings: Function, chosen: Solver
    ) -> None:
        """Slopes are f, crossings g; restart() before the first step."""
        self._chosen = chosen
        self._error: BaseException | None = None
        self._said = ""
        context = c_void_p()
        _check(_new_context(0, byref(context)))
        self._context = context
        self._x, self._smallest = (_new_vector(states, context) for _ in range(2))
        self.x: npt.NDArray[np.float64] = _view(self._x, states)
        """The states now."""
        self._matrix = _new_matrix(states, states, context)
        self._linear = _new_linear(self._x, self._matrix, context)
        self._memory = c_void_p(_create(_BDF, context))
        self._passed = _PASSED(self._guarded(slopes)), _PASSED(self._guarded(crossings, True))
        self._listening = _SAID(self._hear)
        _be_silent(context)
        _tell(context, self._listening, None)
        self.x[:] = 0.0
        _check(_init(self._memory, self._passed[0], 0.0, self._x))
        self._tolerate(np.ones(states))
        if indicators:
            _check(_set_roots(self._memory, indicators, self._passed[1]))
        _check(_set_linear(self._memory, self._linear, self._matrix))
        _check(_set_longest(self._memory, chosen.maximum_step or 0.0))
        _check(_no_warning(self._memory))

    def restart(self, time: float, nominals: npt.NDArray[np.float64] | None = None) -> None:
        """Begin anew at a time, in s, with the states in x; with nominals where these are new."""
        if nominals is not None:
            self._tolerate(nominals)
        _check(_init_again(self._memory, time, self._x))

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
            raise CvodeError(self._said or f"CVode returned {flag}")
        return reached.value, flag == _ROOT_RETURN

    def close(self) -> None:
        """Free all of it."""
        _free(byref(self._memory))
        _free_linear(self._linear)
        _free_matrix(self._matrix)
        for vector in (self._x, self._smallest):
            _free_vector(vector)
        _free_context(byref(self._context))
        del self._passed, self._listening  # they refer to this

    def _tolerate(self, nominals: npt.NDArray[np.float64]) -> None:
        relative, absolute = self._chosen.relative_tolerance, self._chosen.absolute_tolerance
        share = relative / 100.0 if absolute is None else absolute
        _view(self._smallest, len(nominals))[:] = share * nominals
        _check(_set_tolerances(self._memory, relative, self._smallest))

    def _guarded(self, function: Function, roots: bool = False) -> Callable[..., int]:
        """For CVode: what it raises waits until CVode has returned."""

        def passed(time: float, states: int, values: int, _: Any) -> int:
            try:
                return function(time, _data_of(states), values if roots else _data_of(values))
            except BaseException as error:
                self._error = error
                return -1

        return passed

    def _hear(self, _line: int, _of: bytes, _file: bytes, text: bytes, *_: Any) -> None:
        self._said = " ".join((text or b"").decode(errors="replace").split())


def _view(vector: int, size: int) -> npt.NDArray[np.float64]:
    return np.ctypeslib.as_array((c_double * size).from_address(_data_of(vector)))


def _check(status: int) -> None:
    if status < 0:
        raise CvodeError(f"SUNDIALS returned {status}")
