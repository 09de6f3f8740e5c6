"""Proxies with the clock and the network of a test, called by the names of their variables."""

import ctypes
import shutil
import tempfile
import zipfile
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from grasp_cosim.base.c_compilers import Compiler, compile_all
from grasp_cosim.fmu_export.build import compiler_for, job
from grasp_cosim.fmu_export.description import Description
from grasp_cosim.fmu_export.native.targets import this_target
from grasp_cosim.fmu_export.package import write_file
from grasp_cosim.fmu_export.proxy import proxy_members

from .fmi2 import ERROR, OK, Fmu, Instance
from .scripted_peer import VARIABLES, Clock, ScriptedPeer

SHIM = Path(__file__).parents[1] / "fmus/native/proxy_shim.h"
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
NAME = "AnyProxy"

COUNTS = ("missed", "consecutive_missed", "late", "out_of_order", "duplicated", "rejected")

_CLOCK = ctypes.CFUNCTYPE(ctypes.c_int64)
_C = {
    "Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}  # fmt: skip
_PYTHON = {"Boolean": bool, "String": bytes.decode}


def original():
    return Description("Original.fmu", "", VARIABLES, {})


def _sources(members):
    """The sources of a proxy by name."""
    return {n.removeprefix("sources/"): d for n, d in members.items() if n.startswith("sources/")}


def write_sources(folder, fmi=2):
    """The sources of a proxy, into a folder that is there."""
    for file, data in _sources(proxy_members(Path(f"{NAME}.fmu"), original(), fmi)).items():
        (folder / file).write_bytes(data)


@cache
def _fmu():
    """Built once per process, compiled once for all."""
    files = proxy_members(Path(f"{NAME}.fmu"), original(), 2)
    if not shutil.which("gcc"):
        pytest.skip("NO gcc")
    compiler = compiler_for(this_target(), requested=False)
    shimmed = Compiler((*compiler.command, *STRICT, "-include", SHIM.name))
    sources = {**_sources(files), SHIM.name: SHIM.read_bytes()}
    folder = Path(tempfile.mkdtemp(prefix="native_proxy_"))
    made = compile_all([job(NAME, sources, this_target(), shimmed, networked=True)], folder)
    with zipfile.ZipFile(folder / f"{NAME}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", files["modelDescription.xml"])
    write_file(folder / f"u/binaries/{this_target().folder}/{NAME}.so", made[0].read_bytes())
    return Fmu(folder / f"{NAME}.fmu", folder / "u")


class Host:
    """A host with one instance of a proxy; what is refused raises RefusedError."""

    def __init__(self, port, clock, **settings):
        self._fmu = _fmu()
        self._clock = _CLOCK(clock)
        self._instance = Instance(self._fmu, "proxy")
        self.time = 0.0
        self.set(**{"proxy.port": port, "proxy.timeout": 100.0, "proxy.connect_timeout": 100.0})
        settings = {"on_loss": "failsafe", **settings}
        self.set(**{f"proxy.{name}": value for name, value in settings.items()})

    def call(self, function, *arguments):
        """Any function of FMI 2.0, by its name without fmi2; its status."""
        place = ctypes.c_void_p.in_dll(self._fmu.library, "shim_clock")
        place.value = ctypes.cast(self._clock, ctypes.c_void_p).value
        return self._instance.call(function, *arguments)

    def must(self, function, *arguments):
        status = self.call(function, *arguments)
        if status != OK:
            raise RefusedError(status)

    def free(self):
        self.call("FreeInstance")

    def _access(self, action, name, *given):
        kind = self._fmu.kinds[name]
        values = (_C[kind] * 1)(*given)
        reference = (ctypes.c_uint * 1)(self._fmu.references[name])
        self.must(f"{action}{kind}", reference, ctypes.c_size_t(1), values)
        return _PYTHON.get(kind, lambda value: value)(values[0])

    def set(self, **values):
        for name, value in values.items():
            self._access("Set", name, value.encode() if isinstance(value, str) else value)

    def get(self, name):
        return self._access("Get", name)

    def outputs(self):
        return [self.get(v.name) for v in VARIABLES if v.causality == "output"]

    def own(self):
        return [self.get(name) for name in self._fmu.references if name.startswith("proxy.")]

    def state(self):
        return int(self.get("proxy.state"))

    def counts(self):
        """The counters that are not 0."""
        return {name: n for name in COUNTS if (n := self.get(f"proxy.{name}"))}

    def setup(self, start):
        real = ctypes.c_double
        self.must("SetupExperiment", 0, real(0.0), real(start), 0, real(0.0))

    def enter(self):
        self.must("EnterInitializationMode")

    def initialise(self):
        self.setup(0.0)
        self.enter()
        self.must("ExitInitializationMode")
        return self

    def do_step(self, time, size):
        self.must("DoStep", ctypes.c_double(time), ctypes.c_double(size), 1)

    def step(self, size=0.25):
        self.do_step(self.time, size)
        self.time += size

    def terminate(self):
        self.must("Terminate")

    def log(self):
        return [m.text for m in self._instance.log]

    def refused(self, call, *arguments):
        """The one line in the log about a call that is refused."""
        before = len(self.log())
        with pytest.raises(RefusedError) as error:
            call(*arguments)
        assert error.value.args == (ERROR,)
        (line,) = self.log()[before:]
        assert "\n" not in line
        return line


class RefusedError(Exception):
    """A call whose status is not fmi2OK."""


@contextmanager
def hosted(port, clock=None, **how):
    """A host, whose instance is freed in the end."""
    host = Host(port, clock or Clock(), **how)
    try:
        yield host
    finally:
        host.free()


@contextmanager
def connected(clock=None, **how):
    """A proxy in step mode, and its peer."""
    with ScriptedPeer(clock) as peer, hosted(peer.port, peer.clock, **how) as host:
        yield host.initialise(), peer
