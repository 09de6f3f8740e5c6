"""The hot loop compiled with numba (the optional extra `fast`).

What the loop calls gets its counterparts here: calls of FMI functions by their addresses, and
typed buffers by theirs. The GIL is held throughout, so a Python FMU does not have to wait for it.
"""

import ctypes
import hashlib
import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..fmi import instance
from ..fmi.instance import (
    CLOCK,
    EARLY,
    PYTHON,
    STEP_2,
    STEP_3,
    TRANSFER_2,
    TRANSFER_3,
    Call,
    Native,
)
from . import loop

CODES = (
    "float32",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
    "bool",
)
"""Element types of buffers, in the order of their codes."""


class CallTable(NamedTuple):
    """The calls as columns: see fmi.instance.Native."""

    shape: npt.NDArray[np.int64]
    function: npt.NDArray[np.int64]
    instance: npt.NDArray[np.int64]
    references: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]
    data: npt.NDArray[np.int64]
    flags: npt.NDArray[np.int64]
    last: npt.NDArray[np.int64]
    step: npt.NDArray[np.float64]


class BufferTable(NamedTuple):
    """Buffers of other types than float64: code of the type, address, size of an element."""

    code: npt.NDArray[np.int64]
    address: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]


class Calls:
    """The table of some calls; those without a native form are called back in Python."""

    def __init__(self, calls: Sequence[Call]) -> None:
        self._callbacks: list[Any] = []
        natives = [call.native or self._python(call.python) for call in calls]
        columns: list[npt.NDArray[Any]] = [
            np.array(
                [getattr(n, name) for n in natives], np.float64 if name == "step" else np.int64
            )
            for name in CallTable._fields
        ]
        self.table = CallTable(*columns)

    def _python(self, function: Callable[[], int]) -> Native:
        callback = ctypes.PYFUNCTYPE(ctypes.c_int)(function)
        self._callbacks.append(callback)
        return Native(PYTHON, ctypes.cast(callback, ctypes.c_void_p).value or 0, 0)


def buffer_table(buffers: Sequence[npt.NDArray[Any]]) -> BufferTable:
    """The table of the given buffers, which must outlive it."""
    return BufferTable(
        np.array([CODES.index(b.dtype.name) for b in buffers], np.int64),
        np.array([b.ctypes.data for b in buffers], np.int64),
        np.array([b.itemsize for b in buffers], np.int64),
    )


@lru_cache(maxsize=1)
def compiled_loop() -> Callable[..., tuple[int, int, int]]:
    """loop.run() compiled; InputError without numba. What is compiled is kept in a cache folder."""
    try:
        import numba
    except ImportError as error:
        raise InputError(
            "numba is not installed, it compiles the loop; "
            "install it with: pip install 'grasp-cosim[fast]'"
        ) from error
    _register()
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(_cache())
        return numba.njit(loop.run, cache=True)  # type: ignore[no-any-return]
    except RuntimeError:  # the user has no home, or no folder to keep it in can be written to
        return numba.njit(loop.run)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before


def _cache() -> Path:
    """A folder for this very source: numba looks for changes in loop.py only."""
    files = (__file__, loop.__file__, instance.__file__)  # with all constants that are compiled in
    sources = b"".join(Path(f).read_bytes() for f in files)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base, "grasp-cosim", hashlib.sha256(sources).hexdigest()[:16])


def _register() -> None:
    """Teach numba invoke(), load() and store()."""
    from llvmlite import ir
    from numba import carray, types
    from numba.core import cgutils
    from numba.extending import intrinsic, overload

    word, double, status, byte = ir.IntType(64), ir.DoubleType(), ir.IntType(32), ir.IntType(8)

    def function(result: Any, *arguments: Any) -> Any:
        """An intrinsic that calls the C function at an address with arguments of these types."""
        numba_types = [types.float64 if a is double else types.int64 for a in arguments]

        def typed(context: Any, address: Any, *given: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                pointer = ir.FunctionType(result, arguments).as_pointer()
                passed = [
                    builder.trunc(v, a) if isinstance(a, ir.IntType) and a.width < 64 else v
                    for v, a in zip(values[1:], arguments, strict=True)
                ]
                return builder.call(builder.inttoptr(values[0], pointer), passed)

            return types.int32(types.int64, *numba_types), generate

        return typed

    none, clock_gettime = function(status), function(status, status, word)
    transfer_2, transfer_3 = function(status, *[word] * 4), function(status, *[word] * 5)
    step_2 = function(status, word, double, double, status)
    step_3 = function(status, word, double, double, byte, word, word, word, word)

    @intrinsic
    def call_python(typing: Any, f: Any) -> Any:
        return none(typing, f)

    @intrinsic
    def call_clock(typing: Any, f: Any, a: Any, b: Any) -> Any:
        return clock_gettime(typing, f, a, b)

    @intrinsic
    def call_transfer_2(typing: Any, f: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
        return transfer_2(typing, f, a, b, c, d)

    @intrinsic
    def call_transfer_3(typing: Any, f: Any, a: Any, b: Any, c: Any, d: Any, e: Any) -> Any:
        return transfer_3(typing, f, a, b, c, d, e)

    @intrinsic
    def call_step_2(typing: Any, f: Any, a: Any, t: Any, h: Any, b: Any) -> Any:
        return step_2(typing, f, a, t, h, b)

    @intrinsic
    def call_step_3(
        typing: Any, f: Any, a: Any, t: Any, h: Any, b: Any, c: Any, d: Any, e: Any, g: Any
    ) -> Any:
        return step_3(typing, f, a, t, h, b, c, d, e, g)

    @intrinsic
    def pointer(typing: Any, address: Any, like: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], cgutils.voidptr_t)

        return types.voidptr(types.int64, like), generate

    @overload(loop.invoke)
    def invoke(calls: Any, i: Any, clock: Any) -> Any:
        def compiled(calls: Any, i: Any, clock: Any) -> Any:
            shape, f, instance = calls.shape[i], calls.function[i], calls.instance[i]
            refs, size, data = calls.references[i], calls.size[i], calls.data[i]
            if shape == TRANSFER_2:
                return call_transfer_2(f, instance, refs, size, data)
            if shape == STEP_2:
                return call_step_2(f, instance, clock[0], calls.step[i], 1)
            if shape == TRANSFER_3:
                return call_transfer_3(f, instance, refs, size, data, size)
            if shape == STEP_3:
                flags = calls.flags[i]
                status = call_step_3(
                    f, instance, clock[0], calls.step[i], 1, flags, flags + 1, flags + 2,
                    calls.last[i],
                )  # fmt: skip
                said = carray(pointer(flags, 0), 3, np.uint8)
                return EARLY if status <= loop.WORST and (said[1] or said[2]) else status
            if shape == CLOCK:
                status = call_clock(f, instance, refs)
                now = carray(pointer(refs, 0), 2, np.int64)
                carray(pointer(data, 0), 1, np.float64)[0] = now[0] * 1_000_000_000 + now[1] - size
                return status
            return call_python(f)

        return compiled

    @overload(loop.load)
    def load(buffers: Any, i: Any, index: Any) -> Any:
        def compiled(buffers: Any, i: Any, index: Any) -> Any:
            code = buffers.code[i]
            at = pointer(buffers.address[i] + index * buffers.size[i], 0)
            if code == 0:
                return np.float64(carray(at, 1, np.float32)[0])
            if code == 1:
                return np.float64(carray(at, 1, np.int8)[0])
            if code == 9:  # C takes any byte but 0 for true
                return 1.0 if carray(at, 1, np.uint8)[0] else 0.0
            if code == 2:
                return np.float64(carray(at, 1, np.uint8)[0])
            if code == 3:
                return np.float64(carray(at, 1, np.int16)[0])
            if code == 4:
                return np.float64(carray(at, 1, np.uint16)[0])
            if code == 5:
                return np.float64(carray(at, 1, np.int32)[0])
            if code == 6:
                return np.float64(carray(at, 1, np.uint32)[0])
            if code == 7:
                return np.float64(carray(at, 1, np.int64)[0])
            return np.float64(carray(at, 1, np.uint64)[0])

        return compiled

    @overload(loop.store)
    def store(buffers: Any, i: Any, index: Any, value: Any) -> Any:
        def compiled(buffers: Any, i: Any, index: Any, value: Any) -> Any:
            code = buffers.code[i]
            at = pointer(buffers.address[i] + index * buffers.size[i], 0)
            if code == 0:
                carray(at, 1, np.float32)[0] = np.float32(value)
            elif code == 1:
                carray(at, 1, np.int8)[0] = np.int8(value)
            elif code == 2:
                carray(at, 1, np.uint8)[0] = np.uint8(value)
            elif code == 3:
                carray(at, 1, np.int16)[0] = np.int16(value)
            elif code == 4:
                carray(at, 1, np.uint16)[0] = np.uint16(value)
            elif code == 5:
                carray(at, 1, np.int32)[0] = np.int32(value)
            elif code == 6:
                carray(at, 1, np.uint32)[0] = np.uint32(value)
            elif code == 7:
                carray(at, 1, np.int64)[0] = np.int64(value)
            elif code == 8:
                carray(at, 1, np.uint64)[0] = np.uint64(value)
            else:
                carray(at, 1, np.uint8)[0] = value != 0.0

        return compiled
