"""The two engines: the loop as plain Python, and the same loop in C.

That in C is compiled by the user's compiler at the first need, kept, and loaded; what is kept
serves every later process: a file for each state of the source and the compiler. Where no component
is Python it runs without Python's lock (the GIL), which callbacks take for themselves.

Which one "auto" takes is known before the run: that in C where it is there already, which it is
once it was built on this machine; a long run, or one in real time, builds it.
"""

import ctypes
import logging
import signal
import socket
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from threading import Thread
from typing import Any, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from ..base import calls as shapes
from ..base.c_compilers import CompilerError, Job, cache, compile_all, find_compiler
from ..base.calls import PYTHON, Native
from ..base.checks import choice
from ..base.errors import InputError
from ..base.scratch import ScratchFolder
from ..base.system_calls import be_ordinary
from ..fmi.instance import DUE, EARLY, EVENT
from ..realtime import pacer, timing
from ..system.times import NANOSECONDS
from . import loop
from .plan import Plan

Engine = Literal["auto", "python", "compiled"]
LOGGER = logging.getLogger(__name__)
"""Gets which engine runs at the level INFO."""

ENGINES: tuple[str, ...] = get_args(Engine)

LONG = 20_000
"""Steps of a run for which the loop is built in C where it is not there: that takes 0.1 to 0.3 s
once on a machine, and saves about 20 us a step of the grasp.
"""

SOURCE = Path(__file__).with_name("loop.c")

ELEMENTS = (
    *("float32", "bool", "int8", "uint8", "int16", "uint16"),
    *("int32", "uint32", "int64", "uint64"),
)
"""The element types of buffers; the source has them in capitals."""

REMEDY = "engine python needs no compiler"

PAUSE = 0.02
"""s between two times that rows are handed on next to the loop."""

_OVER = 0
"""Through the sockets of Aside comes the number of a signal, or this."""


_CALL = [(name, "f8" if name == "step" else "i8") for name in Native._fields]


class _Shared(ctypes.Structure):
    _fields_ = [
        (n, ctypes.c_int64) for n in ("operation", "status", "done", "taken", "halt", "ended")
    ]


class CompiledLoop:
    """The compiled loop over a plan.

    only says that it makes no call of Python at all. It then may run while another thread looks at
    shared.done, the number of the steps whose rows are there. The thread sets shared.taken to give
    rows back, or sets shared.halt. shared.ended is the wall time in ns at which the last step
    ended.
    """

    def __init__(self, plan: Plan) -> None:
        """InputError as of library()."""
        callbacks = [ctypes.CFUNCTYPE(ctypes.c_int)(call.python) for call in plan.calls]
        calls = [
            call.native or Native(PYTHON, ctypes.cast(callback, ctypes.c_void_p).value or 0, 0)
            for call, callback in zip(plan.calls, callbacks, strict=True)
        ]
        buffers = [(ELEMENTS.index(b.dtype.name), b.ctypes.data) for b in plan.buffers]
        drives = [
            (d.slot, d.linear, len(d.times), 0, *(a.buffer_info()[0] for a in (d.times, d.samples)))
            for d in plan.drives
        ]
        tables = [
            np.array(plan.operations, np.int64),
            np.array(plan.connections, "i8, i8, f8, f8"),
            *(np.array(table, np.int64) for table in (plan.casts, buffers, drives)),
            plan.watches,
            plan.exchanges,
            np.array(calls, _CALL),
        ]
        operations, *addresses, values, clock, warned, magnitudes, exceeded = (
            table.ctypes.data
            for table in (
                *tables,
                *(plan.values, plan.clock, plan.warned),
                *(plan.bounds.magnitudes, plan.bounds.exceeded),
            )
        )
        program = (
            operations,
            len(plan.operations),
            *addresses,
            values,
            len(plan.values),
            clock,
            warned,
            magnitudes,
            len(plan.bounds.magnitudes),
            exceeded,
        )
        words = np.array(program, np.int64)
        self._kept = plan, callbacks, tables, words
        self.shared = _Shared()
        self._drives = tables[4]
        self._rows, self._place = None, 0
        self.alone = all(call.native and not call.keeps_lock for call in plan.calls)
        self._places = words.ctypes.data, ctypes.addressof(self.shared)
        self._run = library(any(call.keeps_lock for call in plan.calls)).run

    def saved(self) -> npt.NDArray[np.int64]:
        """The rows of the drives, for restore(): all that the loop keeps for itself."""
        return self._drives.copy()

    def restore(self, saved: npt.NDArray[np.int64]) -> None:
        """Go back to what was saved."""
        self._drives[:] = saved

    def __call__(
        self,
        rows: Any,
        operation: int,
        start: int,
        stop: int,
        grid_start: int,
        grid_step: int,
        per_second: int,
        row: int = 0,
        ring: bool = False,
    ) -> tuple[int, int, int]:
        """As loop.run(), from a row on. In a ring, rows are filled round and round."""
        tables, shared = self._places
        if rows is not self._rows:
            self._rows, self._place = rows, rows.ctypes.data
        self.shared.done = start
        if not ring:
            self.shared.taken = start - row
        step = self._run(
            tables, self._place, len(rows), row, operation, start, stop,
            grid_start, grid_step, per_second, shared,
        )  # fmt: skip
        return step, self.shared.operation, self.shared.status


Loop = Callable[..., tuple[int, int, int]]
"""loop.run() over a plan: takes rows, operation, start, stop, the grid of its times, and row: which
of the rows is the first.
"""


def make_loop(plan: Plan, engine: Engine, steps: int | None = None) -> Loop:
    """Return the loop over a plan, for a run of so many `steps`, None for one in real time.

    InputError where it is to be compiled and cannot be.
    """
    choice("engine", engine, ENGINES)
    plan.warned.resize(2 * len(plan.calls), refcheck=False)
    long, auto = steps is None or steps >= LONG, engine == "auto"
    if engine == "compiled" or (auto and (is_there() or (long and has_compiler()))):
        try:
            compiled = CompiledLoop(plan)
        except InputError as error:  # of a compiler that does not work
            if not auto:
                raise
            LOGGER.info("%s", error)
        else:
            LOGGER.info("engine: the loop in C")
            return compiled
    LOGGER.info("engine: the loop in Python")
    return _interpreted(plan)


def _interpreted(plan: Plan) -> Loop:
    buffers = [memoryview(b) for b in plan.buffers]  # type: ignore[arg-type]
    values, clock = memoryview(plan.values), memoryview(plan.clock)  # type: ignore[arg-type]
    warned = memoryview(plan.warned)  # type: ignore[arg-type]
    watches, exchanges = ([memoryview(row) for row in t] for t in (plan.watches, plan.exchanges))
    tables = plan.operations, plan.connections, plan.casts, plan.drives, watches, exchanges
    calls = [call.python for call in plan.calls]
    run_plan = partial(loop.run, *tables, calls, buffers, values, clock, warned)

    def run(rows: Any, *bounds: int, row: int = 0) -> tuple[int, int, int]:
        return run_plan(memoryview(rows[row:].reshape(-1)), *bounds)

    return run


@lru_cache(maxsize=1)
def _file() -> tuple[Path, ScratchFolder | None]:
    """The library on disk, built where it is not kept; InputError as of library().

    With a folder that ends with this process, in which it is where nothing can be kept.
    """
    try:
        if kept_library := cache.kept(_job().kept_as):
            return kept_library, None
        scratch = ScratchFolder()
        (library,) = compile_all([_job()], Path(scratch.name))
        return library, scratch
    except (ValueError, CompilerError) as error:
        raise InputError(f"engine compiled: {error}; {REMEDY}") from error


@lru_cache(maxsize=2)
def library(locked: bool) -> ctypes.CDLL:
    """The compiled loop, which runs with Python's lock held (the GIL) or without.

    InputError where it has to be built and there is no compiler, or it fails.
    """
    path, _ = _file()
    try:
        loaded: ctypes.CDLL = (ctypes.PyDLL if locked else ctypes.CDLL)(str(path))
    except OSError as error:
        raise InputError(f"{path}: the compiled loop does not load: {error}; {REMEDY}") from error
    loaded.run.restype = ctypes.c_int64
    integer, pointer = ctypes.c_int64, ctypes.c_void_p
    loaded.run.argtypes = [pointer, pointer, *[integer] * 8, pointer]
    return loaded


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
    names_of = {
        loop: "COPY SCALE STORE LOAD LOAD_LONG DRIVE WATCH EXCHANGE CALL STEP TOO_LONG EXACT WORST "
        "FULL HALTED OVERRUN WATCHED STALLED",
        shapes: "TRANSFER_2 TRANSFER_3 STEP_2 STEP_3 CLOCK PACE READ",
        timing: "ARRIVED LATE SCHEDULED BEGIN",
    }
    shared = {
        **{n: getattr(module, n) for module, names in names_of.items() for n in names.split()},
        "EARLY": EARLY,
        "EVENT": EVENT,
        "DUE": DUE,
        "SLICE": pacer.SLICE_NS,
        "NAP": round(pacer.NAP * NANOSECONDS),
        **{name.upper(): code for code, name in enumerate(ELEMENTS)},
    }
    return [f"{name}={value!r}" for name, value in shared.items()]


class Aside:
    """A context in which another thread acts from time to time, at no special priority.

    So rows are handed on while the loop runs without Python's lock. halt is called where a signal
    arrives, whose handler could not run before the loop ends, or where `act` fails; its error is
    raised at the end.
    """

    def __init__(
        self, act: Callable[[], None], halt: Callable[[], None], cpus: Collection[int]
    ) -> None:
        """Cpus are those that the thread may run on."""
        self._act, self._halt, self._cpus = act, halt, cpus
        self._thread = Thread(target=self._run, daemon=True)
        self.error: BaseException | None = None

    def __enter__(self) -> Self:
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        self._reader.settimeout(PAUSE)
        self._before: int | None = None
        with suppress(ValueError):  # in another thread than the main one there are no signals
            self._before = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Have it end; raises the error of `act`."""
        if self._before is not None:
            signal.set_wakeup_fd(self._before)
        self._writer.send(bytes([_OVER]))
        self._thread.join()
        self._writer.close()
        self._reader.close()
        if self.error is not None:
            raise self.error

    def _run(self) -> None:
        be_ordinary(self._cpus)  # the loop's own would be inherited
        while True:
            came = b""
            with suppress(TimeoutError):
                came = self._reader.recv(64)
            if _OVER in came:
                return
            if came:
                self._halt()
            if self.error is None:
                try:
                    self._act()
                except BaseException as error:
                    self.error = error
                    self._halt()
