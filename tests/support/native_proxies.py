"""Native proxies with the clock and the network of a test, called as pythonfmu calls a slave."""

import ctypes
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from c_compilers import Compiler, compile_all
from grasp_fmus.base import LoggedError, Message
from grasp_fmus.build import compiler_for, job
from grasp_fmus.description import Experiment
from grasp_fmus.native.proxy import proxy_members
from grasp_fmus.native.targets import Version, here
from grasp_fmus.package import write_file
from grasp_fmus.proxy import DEFAULTS, bounded, own_variables
from grasp_fmus.proxy_build import Original
from grasp_fmus.variable import TYPES, Variable

from .fmi2 import DISCARD, OK, Fmu, Instance

SHIM = Path(__file__).parents[1] / "fmus/native/proxy_shim.h"
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
NAME = "AnyProxy"

_CLOCK = ctypes.CFUNCTYPE(ctypes.c_int64)
_LOOK_UP = ctypes.CFUNCTYPE(ctypes.c_int)
_SEND = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t)
_HOOKS = ("clock", "send", "look_up")
_C: dict[str, Any] = {
    "Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}  # fmt: skip


@cache
def _fmu(variables: tuple[Variable, ...], fmi: Version) -> Fmu:
    """Built once per process, compiled once for all."""
    original = Original("Original.fmu", variables, {}, Experiment(), True)
    files = proxy_members(Path(f"{NAME}.fmu"), original, fmi, DEFAULTS)
    sources = {n.removeprefix("sources/"): d for n, d in files.items() if n.startswith("sources/")}
    try:
        compiler = compiler_for(here(), asked=False)
    except ValueError as error:
        pytest.skip(f"NO compiler: {error}")
    shimmed = Compiler((*compiler.command, *STRICT, "-include", SHIM.name))
    sources = {**sources, SHIM.name: SHIM.read_bytes()}
    folder = Path(tempfile.mkdtemp(prefix="native_proxy_"))
    made = compile_all([job(NAME, sources, here(), shimmed, networked=True)], folder)
    place = here().folder if fmi == 2 else here().tuple
    with zipfile.ZipFile(folder / f"{NAME}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", files["modelDescription.xml"])
    write_file(folder / f"u/binaries/{place}/{NAME}.so", made[0].read_bytes())
    return Fmu(folder / f"{NAME}.fmu", folder / "u")


class NativeSlave:
    """A native proxy, called as a Python one."""

    def __init__(
        self, variables: Sequence[Variable], clock: Callable[[], int], fmi: Version
    ) -> None:
        outputs = [v for v in variables if v.causality == "output"]
        self._variables = bounded([*variables, *own_variables(outputs)], len(variables))
        fmu = _fmu(tuple(variables), fmi)
        self._hooks = _CLOCK(clock), _SEND(self._sent), _LOOK_UP(self._looked_up)
        self.intercept: Callable[[bytes], None] = lambda datagram: None
        """Called with what is sent; it may raise an OSError instead."""
        self.look_up: Callable[[], None] = lambda: None
        """Called before a name is looked up, in the thread that does so."""
        self._instance = Instance(fmu, "proxy")

    def __del__(self) -> None:
        if hasattr(self, "_instance"):
            self._call("FreeInstance")

    def _sent(self, at: int, size: int) -> int:
        try:
            self.intercept(ctypes.string_at(at, size))
        except OSError as error:
            return error.errno or -1
        return 0

    def _looked_up(self) -> int:
        self.look_up()
        return 0

    def _call(self, function: str, *arguments: Any) -> int:
        library = self._instance.fmu.library
        places = [ctypes.c_void_p.in_dll(library, f"shim_{name}") for name in _HOOKS]
        before = [place.value for place in places]  # one that goes may do so in another's call
        for place, hook in zip(places, self._hooks, strict=True):
            place.value = ctypes.cast(hook, ctypes.c_void_p).value
        status = self._instance.call(function, *arguments)
        for place, value in zip(places, before, strict=True):
            place.value = value
        if function != "FreeInstance" and status not in (OK, DISCARD):
            raise LoggedError
        return status

    def _get_log_queue(self) -> list[Message]:
        return [Message(m.status, m.category, m.text) for m in self._instance.log]

    def setup_experiment(self, start: float) -> None:
        real = ctypes.c_double
        self._call("SetupExperiment", 0, real(0.0), real(start), 0, real(0.0))

    def enter_initialization_mode(self) -> None:
        self._call("EnterInitializationMode")

    def exit_initialization_mode(self) -> None:
        self._call("ExitInitializationMode")

    def do_step(self, time: float, size: float) -> bool:
        return self._call("DoStep", ctypes.c_double(time), ctypes.c_double(size), 1) == OK

    def terminate(self) -> None:
        self._call("Terminate")

    def _get_fmu_state(self) -> None:
        self._call("GetFMUstate", ctypes.byref(ctypes.c_void_p()))

    def _set_fmu_state(self, _: bytes) -> None:
        self._call("SetFMUstate", None)

    def state_to_bytes(self, _: bytes) -> None:
        self._call("SerializeFMUstate", None, None, ctypes.c_size_t(0))

    def state_from_bytes(self, _: bytes) -> None:
        self._call("DeSerializeFMUstate", None, ctypes.c_size_t(0), None)

    def _get(self, kind: str, vrs: Sequence[int]) -> list[Any]:
        n = len(vrs)
        values = (_C[kind] * n)()
        self._call(f"Get{kind}", (ctypes.c_uint * n)(*vrs), ctypes.c_size_t(n), values)
        return [_TO_PYTHON[kind](v) for v in values]

    def _set(self, kind: str, vrs: Sequence[int], values: Sequence[Any]) -> None:
        n = len(vrs)
        given = (_C[kind] * n)(*(v.encode() if isinstance(v, str) else v for v in values))
        self._call(f"Set{kind}", (ctypes.c_uint * n)(*vrs), ctypes.c_size_t(n), given)


_TO_PYTHON: dict[str, Callable[[Any], Any]] = {
    "Real": float, "Integer": int, "Boolean": bool, "String": bytes.decode,
}  # fmt: skip


def _access(kind: str) -> None:
    def get(self: NativeSlave, vrs: Sequence[int]) -> list[Any]:
        return self._get(kind, vrs)

    def set_(self: NativeSlave, vrs: Sequence[int], values: Sequence[Any]) -> None:
        self._set(kind, vrs, values)

    setattr(NativeSlave, f"get_{kind.lower()}", get)
    setattr(NativeSlave, f"set_{kind.lower()}", set_)


for _kind in TYPES.values():
    _access(_kind)
