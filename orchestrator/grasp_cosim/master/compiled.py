"""The hot loop compiled with numba (the optional extra `fast`).

What the loop calls gets its counterparts here: calls of FMI functions by their addresses, and
typed buffers by theirs. The GIL is held throughout, so a Python FMU does not have to wait for it.
"""

import ctypes
import hashlib
import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from inspect import Parameter, Signature
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..checks import extra_module
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

_WHOLE = [f"{sign}int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "u")]
ELEMENTS = {name: code for code, name in enumerate(["float32", "boolean", *_WHOLE])}
"""The element types of buffers, as numba names them, and their codes."""

ARGUMENTS = {
    PYTHON: "",
    CLOCK: "iw",
    TRANSFER_2: "wwww",
    TRANSFER_3: "wwwww",
    STEP_2: "wddi",
    STEP_3: "wddbwwww",
}
"""The arguments of C functions by the shape of their calls, a letter each: w is a word or an
address, d a double, i an int, b a byte.
"""


class BufferTable(NamedTuple):
    """Buffers of other types than float64: codes of their types, and addresses."""

    code: npt.NDArray[np.int64]
    address: npt.NDArray[np.int64]


def call_table(calls: Sequence[Call]) -> tuple[Native, list[Any]]:
    """Return the calls as columns, each field of the Native an array; and what must outlive them.

    Those without a native form are called back in Python.
    """
    callbacks = [ctypes.PYFUNCTYPE(ctypes.c_int)(call.python) for call in calls]
    natives = [
        call.native or Native(PYTHON, ctypes.cast(callback, ctypes.c_void_p).value or 0, 0)
        for call, callback in zip(calls, callbacks, strict=True)
    ]
    table = Native._make(
        np.array([call[i] for call in natives], np.float64 if name == "step" else np.int64)
        for i, name in enumerate(Native._fields)
    )
    return table, callbacks


def buffer_table(buffers: Sequence[npt.NDArray[Any]]) -> BufferTable:
    """Return the table of the given buffers, which must outlive it."""
    names = [b.dtype.name.replace("bool", "boolean") for b in buffers]
    return BufferTable(
        np.array([ELEMENTS[name] for name in names], np.int64),
        np.array([b.ctypes.data for b in buffers], np.int64),
    )


@lru_cache(maxsize=1)
def compiled_loop() -> Callable[..., tuple[int, int, int]]:
    """Return loop.run() compiled. What is compiled is kept in a cache folder.

    InputError without numba.
    """
    numba = extra_module("numba", "it compiles the loop", "fast")
    _register_invoke()
    _register_buffers()
    before = numba.config.CACHE_DIR
    try:
        numba.config.CACHE_DIR = str(_cache())
        return numba.njit(loop.run, cache=True)  # type: ignore[no-any-return]
    except RuntimeError:  # the user has no home, or no folder to keep it in can be written to
        return numba.njit(loop.run)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before


def _cache() -> Path:
    """Return a folder for this very source: numba looks for changes in loop.py only."""
    files = (__file__, loop.__file__, instance.__file__)  # with all constants that are compiled in
    sources = b"".join(Path(f).read_bytes() for f in files)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base, "grasp-cosim", hashlib.sha256(sources).hexdigest()[:16])


def _intrinsic(names: str, result: str, generate: Callable[..., Any]) -> Any:
    """Return a function of compiled code whose body is what `generate` builds.

    `names` are those of its arguments, all of type int64 but for d... of float64; `result` is the
    numba type that it returns. `generate` takes numba's context, the builder and the arguments.
    """
    from numba import types
    from numba.extending import intrinsic

    def typed(typing: Any, *given: Any) -> Any:
        taken = [types.float64 if n[0] == "d" else types.int64 for n in names.split()]
        made = getattr(types, result)(*taken)
        return made, lambda context, builder, _, values: generate(context, builder, *values)

    typed.__signature__ = Signature(  # type: ignore[attr-defined]
        [Parameter(n, Parameter.POSITIONAL_ONLY) for n in ["typing", *names.split()]]
    )
    return intrinsic(typed)


def _c_function(arguments: str) -> Any:
    """Return an intrinsic that calls the C function at an address: see ARGUMENTS."""
    from llvmlite import ir

    word, status = ir.IntType(64), ir.IntType(32)
    kinds = {"w": word, "d": ir.DoubleType(), "i": status, "b": ir.IntType(8)}
    declared = [kinds[a] for a in arguments]

    def generate(context: Any, builder: Any, address: Any, *given: Any) -> Any:
        pointer = ir.FunctionType(status, declared).as_pointer()
        passed = [
            builder.trunc(value, kinds[a]) if a in "ib" else value
            for a, value in zip(arguments, given, strict=True)
        ]
        return builder.call(builder.inttoptr(address, pointer), passed)

    names = [f"{'d' if a == 'd' else 'w'}{i}" for i, a in enumerate(arguments)]
    return _intrinsic(" ".join(["address", *names]), "int32", generate)


def _register_invoke() -> None:
    """Teach numba invoke(): a call by its shape."""
    from numba import carray
    from numba.core import types
    from numba.extending import overload

    call_python, call_clock, transfer_2, transfer_3, step_2, step_3 = (
        _c_function(ARGUMENTS[shape])
        for shape in (PYTHON, CLOCK, TRANSFER_2, TRANSFER_3, STEP_2, STEP_3)
    )
    pointer = _intrinsic(
        "address",
        "voidptr",
        lambda context, builder, address: builder.inttoptr(
            address, context.get_value_type(types.voidptr)
        ),
    )

    @overload(loop.invoke)
    def invoke(calls: Any, i: Any, clock: Any) -> Any:
        def compiled(calls: Any, i: Any, clock: Any) -> Any:
            shape, f, instance = calls.shape[i], calls.function[i], calls.instance[i]
            refs, size, data = calls.references[i], calls.size[i], calls.data[i]
            if shape == TRANSFER_2:
                return transfer_2(f, instance, refs, size, data)
            if shape == STEP_2:
                return step_2(f, instance, clock[0], calls.step[i], 1)
            if shape == TRANSFER_3:
                return transfer_3(f, instance, refs, size, data, size)
            if shape == STEP_3:
                flags, last = calls.flags[i], calls.last[i]
                time, step = clock[0], calls.step[i]
                status = step_3(f, instance, time, step, 1, flags, flags + 1, flags + 2, last)
                said = carray(pointer(flags), 3, np.uint8)
                return EARLY if status <= loop.WORST and (said[1] or said[2]) else status
            if shape == CLOCK:
                status = call_clock(f, instance, refs)
                now = carray(pointer(refs), 2, np.int64)
                carray(pointer(data), 1, np.float64)[0] = now[0] * 1_000_000_000 + now[1] - size
                return status
            return call_python(f)

        return compiled


def _register_buffers() -> None:
    """Teach numba load() and store(): by the code of the element type, the same for each."""
    from numba import types
    from numba.core import cgutils
    from numba.extending import overload

    def elements(context: Any, builder: Any, code: Any, address: Any, index: Any) -> Any:
        """Build, for the type of each code, what follows where it is that of the buffer."""
        for name, number in ELEMENTS.items():
            element = getattr(types, name)
            with builder.if_then(builder.icmp_signed("==", code, code.type(number))):
                start = builder.inttoptr(address, context.get_data_type(element).as_pointer())
                yield element, builder.gep(start, [index])

    def generate_load(context: Any, builder: Any, code: Any, address: Any, index: Any) -> Any:
        result = cgutils.alloca_once(builder, context.get_value_type(types.float64))
        for element, place in elements(context, builder, code, address, index):
            found = context.unpack_value(builder, element, place)  # a byte but 0 is true, as in C
            builder.store(context.cast(builder, found, element, types.float64), result)
        return builder.load(result)

    def generate_store(
        context: Any, builder: Any, code: Any, address: Any, index: Any, value: Any
    ) -> Any:
        for element, place in elements(context, builder, code, address, index):
            cast = context.cast(builder, value, types.float64, element)
            context.pack_value(builder, element, cast, place)
        return context.get_dummy_value()

    load_element = _intrinsic("code address index", "float64", generate_load)
    store_element = _intrinsic("code address index double", "void", generate_store)

    @overload(loop.load)
    def load(buffers: Any, i: Any, index: Any) -> Any:
        def compiled(buffers: Any, i: Any, index: Any) -> Any:
            return load_element(buffers.code[i], buffers.address[i], index)

        return compiled

    @overload(loop.store)
    def store(buffers: Any, i: Any, index: Any, value: Any) -> Any:
        def compiled(buffers: Any, i: Any, index: Any, value: Any) -> Any:
            store_element(buffers.code[i], buffers.address[i], index, value)

        return compiled
