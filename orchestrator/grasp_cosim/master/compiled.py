"""The hot loop in C: compiled by the user's compiler at the first need, kept, and loaded.

What is kept serves every later process: a file for each state of the source and the compiler. Where
no component is Python the loop runs without Python's lock (the GIL), which callbacks take for
themselves.
"""

import ctypes
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from c_compilers import CompilerError, Job, cache, compile_all, find_compiler

from ..base import calls as shapes
from ..base.calls import PYTHON, Native
from ..base.errors import InputError
from ..base.scratch import ScratchFolder
from ..fmi.instance import EARLY
from ..realtime import pacer, timing
from ..system.parts import NANOSECONDS
from . import loop
from .plan import Plan

SOURCE = Path(__file__).with_name("loop.c")

ELEMENTS = (
    *("float32", "bool", "int8", "uint8", "int16", "uint16"),
    *("int32", "uint32", "int64", "uint64"),
)
"""The element types of buffers; the source has them in capitals."""

REMEDY = "engine python needs no compiler"


class _Operation(ctypes.Structure):
    _fields_ = [(n, ctypes.c_int64) for n in ("kind", "first", "last", "period", "phase")]


class _Connection(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_int64) for n in ("source", "target")),
        *((n, ctypes.c_double) for n in ("factor", "offset")),
    ]


class _Cast(ctypes.Structure):
    _fields_ = [(n, ctypes.c_int64) for n in ("buffer", "index", "slot")]


class _Buffer(ctypes.Structure):
    _fields_ = [("element", ctypes.c_int64), ("data", ctypes.c_void_p)]


class _Drive(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_int64) for n in ("slot", "linear", "rows", "row")),
        *((n, ctypes.c_void_p) for n in ("times", "samples")),
    ]


class _Call(ctypes.Structure):
    _fields_ = [
        ("shape", ctypes.c_int64),
        *((n, ctypes.c_void_p) for n in ("function", "instance", "references")),
        ("size", ctypes.c_int64),
        ("data", ctypes.c_void_p),
        ("step", ctypes.c_double),
        *((n, ctypes.c_void_p) for n in ("flags", "last")),
        ("values", ctypes.c_int64),
    ]


class _Plan(ctypes.Structure):
    _fields_ = [
        ("operations", ctypes.POINTER(_Operation)),
        ("size", ctypes.c_int64),
        ("connections", ctypes.POINTER(_Connection)),
        ("casts", ctypes.POINTER(_Cast)),
        ("buffers", ctypes.POINTER(_Buffer)),
        ("drives", ctypes.POINTER(_Drive)),
        ("calls", ctypes.POINTER(_Call)),
        ("values", ctypes.c_void_p),
        ("width", ctypes.c_int64),
        ("clock", ctypes.c_void_p),
    ]


class _Shared(ctypes.Structure):
    _fields_ = [
        (n, ctypes.c_int64) for n in ("operation", "status", "done", "taken", "halt", "ended")
    ]


class CompiledLoop:
    """The compiled loop over a plan.

    alone says that it makes no call of Python at all. It then may run while another thread looks
    at shared.done, the number of the steps whose rows are there, sets shared.taken once it does
    not need the rows of so many any more, or sets shared.halt. shared.ended is the wall time in ns
    at which the last step ended.
    """

    def __init__(self, plan: Plan) -> None:
        """InputError as of library()."""
        self._callbacks = [ctypes.CFUNCTYPE(ctypes.c_int)(call.python) for call in plan.calls]
        calls = [
            call.native or Native(PYTHON, ctypes.cast(callback, ctypes.c_void_p).value or 0, 0)
            for call, callback in zip(plan.calls, self._callbacks, strict=True)
        ]
        buffers = [(ELEMENTS.index(b.dtype.name), b.ctypes.data) for b in plan.buffers]
        drives = [
            (
                d.slot,
                d.linear,
                len(d.times),
                0,
                d.times.buffer_info()[0],
                d.samples.buffer_info()[0],
            )
            for d in plan.drives
        ]
        self._plan = plan
        self._tables = _Plan(
            _table(_Operation, plan.operations), len(plan.operations),
            _table(_Connection, plan.connections), _table(_Cast, plan.casts),
            _table(_Buffer, buffers), _table(_Drive, drives), _table(_Call, calls),
            plan.values.ctypes.data, len(plan.values), plan.clock.ctypes.data,
        )  # fmt: skip
        self.shared = _Shared()
        self.alone = all(call.native and not call.keeps_lock for call in plan.calls)
        self._places = ctypes.addressof(self._tables), ctypes.addressof(self.shared)
        self._run = library(any(call.keeps_lock for call in plan.calls)).run

    def __call__(
        self,
        rows: Any,
        operation: int,
        start: int,
        stop: int,
        start_ns: int,
        step_ns: int,
        row: int | None = None,
    ) -> tuple[int, int, int]:
        """As loop.run(). Given the row of the first step, rows are filled round and round."""
        tables, shared = self._places
        self.shared.done = start
        if row is None:
            self.shared.taken, row = start, 0
        place, room = rows.ctypes.data, len(rows)
        step = self._run(
            tables, place, room, row, operation, start, stop, start_ns, step_ns, shared
        )
        return step, self.shared.operation, self.shared.status


def _table(row: type[ctypes.Structure], rows: Sequence[Any]) -> Any:
    return (row * len(rows))(*rows)


@lru_cache(maxsize=1)
def _file() -> tuple[Path, ScratchFolder | None]:
    """The library on disk, built where it is not kept; InputError as of library().

    With a folder that ends with this process, in which it is where nothing can be kept.
    """
    try:
        if kept := cache.kept(_job().kept_as):
            return kept, None
        scratch = ScratchFolder()
        (made,) = compile_all([_job()], Path(scratch.name))
        return made, scratch
    except (ValueError, CompilerError) as error:
        raise InputError(f"engine compiled: {error}; {REMEDY}") from error


@lru_cache(maxsize=2)
def library(locked: bool) -> ctypes.CDLL:
    """The compiled loop, which runs with Python's lock held (the GIL) or without.

    InputError where it has to be built and there is no compiler, or it fails.
    """
    path, _ = _file()
    try:
        found: ctypes.CDLL = (ctypes.PyDLL if locked else ctypes.CDLL)(str(path))
    except OSError as error:
        raise InputError(f"{path}: the compiled loop does not load: {error}; {REMEDY}") from error
    found.run.restype = ctypes.c_int64
    whole, place = ctypes.c_int64, ctypes.c_void_p
    found.run.argtypes = [place, place, *[whole] * 7, place]
    return found


def is_there() -> bool:
    """Return True if the compiled loop need not be built."""
    with suppress(ValueError):
        return bool(library.cache_info().currsize or cache.kept(_job().kept_as))
    return False


def has_compiler() -> bool:
    """Return True if there is a C compiler."""
    with suppress(ValueError):
        return bool(find_compiler())
    return False


def _job() -> Job:
    """What the library is made of; ValueError where there is no compiler."""
    return Job("loop", {SOURCE.name: SOURCE.read_bytes()}, find_compiler(), defined=_constants())


def _constants() -> list[str]:
    """The numbers that the source shares with the other modules, as macros of a compiler."""
    shared = {
        **{n: getattr(loop, n) for n in ("COPY", "SCALE", "STORE", "LOAD", "LOAD_LONG", "DRIVE")},
        **{n: getattr(loop, n) for n in ("CALL", "STEP", "TOO_LONG", "EXACT", "WORST")},
        **{n: getattr(loop, n) for n in ("FULL", "HALTED", "OVERRUN")},
        **{n: getattr(shapes, n) for n in ("TRANSFER_2", "TRANSFER_3", "STEP_2", "STEP_3")},
        **{n: getattr(shapes, n) for n in ("CLOCK", "PACE")},
        "EARLY": EARLY,
        **{n: getattr(timing, n) for n in ("ARRIVED", "LATE", "DUE", "BEGIN")},
        "SLICE": pacer.SLICE_NS,
        "NAP": round(pacer.NAP * NANOSECONDS),
        **{name.upper(): code for code, name in enumerate(ELEMENTS)},
    }
    return [f"{name}={value!r}" for name, value in shared.items()]
