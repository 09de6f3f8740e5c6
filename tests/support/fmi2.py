"""An FMI 2.0 host as plain as can be: every call returns its status, every log message is kept."""

import ctypes
import platform
import re
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cached_property
from math import sin
from typing import NamedTuple
from xml.etree import ElementTree
from zipfile import ZipFile

from . import fmi3

PYTHONFMU = re.compile(r"\AFatal py exception encountered: \[\w+\] \w+\n")
"""What pythonfmu puts before the reason of a slave, and the status that it gives it."""

OK, WARNING, DISCARD, ERROR, FATAL = range(5)

KINDS = {kind: kind for kind in ("Real", "Boolean", "Integer", "String")}
KINDS |= {"Enumeration": "Integer", "Float64": "Real", "Int32": "Integer"}
"""By the element of a variable, the functions that get and set it."""

HERE = {2: "linux64", 3: f"{platform.machine()}-linux"}
"""The folder of binaries, by the version of FMI."""

_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
_ALLOCATE = ctypes.CFUNCTYPE(c_void_p, c_size_t, c_size_t)
_FREE = ctypes.CFUNCTYPE(None, c_void_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER),
        ("allocate", _ALLOCATE),
        ("free", _FREE),
        ("finished", c_void_p),
        ("environment", c_void_p),
    )


class Logged(NamedTuple):
    """A message as the host's logger got it."""

    instance: str
    status: int
    category: str
    text: str


def read_members(fmu):
    """The files in an FMU by name."""
    with ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


class Fmu:
    """An FMU, extracted into a folder, and loaded when it is first called."""

    def __init__(self, path, folder):
        with ZipFile(path) as archive:
            archive.extractall(folder)
        self.folder = folder
        self.python = (folder / "resources/slavemodule.txt").exists()
        self.refused = FATAL if self.python else ERROR
        self.discarded = FATAL if self.python else DISCARD
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.fmi = int(root.get("fmiVersion", "")[0])
        self.guid = root.get("guid", root.get("instantiationToken", ""))
        self.name = root.get("modelName", "")
        listed = root.find("ModelVariables")
        assert listed is not None
        variables = [v for v in listed if v.get("causality") != "independent"]
        tags = [(v[0] if self.fmi == 2 else v).tag for v in variables]
        self.references = {v.get("name", ""): int(v.get("valueReference", "")) for v in variables}
        self.causalities = {v.get("name", ""): v.get("causality", "") for v in variables}
        self.kinds = {v.get("name", ""): KINDS[tag] for v, tag in zip(variables, tags, strict=True)}
        self.enumerations = {
            int(v.get("valueReference", ""))
            for v, tag in zip(variables, tags, strict=True)
            if tag == "Enumeration"
        }
        self.booleans = {name for name, kind in self.kinds.items() if kind == "Boolean"}
        self.tunable = [v.get("name", "") for v in variables if v.get("variability") == "tunable"]
        self.binary = folder / "binaries" / HERE[self.fmi] / f"{self.name}.so"

    @cached_property
    def library(self):
        found = ctypes.CDLL(str(self.binary))
        if self.fmi == 2:
            found.fmi2Instantiate.restype = c_void_p
        return found

    def names(self, causality):
        """The variables of a causality."""
        return [name for name, c in self.causalities.items() if c == causality]


class _Calls:
    """The functions of one instance for FMI 2.0."""

    def __init__(self, library, guid, resources, name, logging, log):
        self._library = library
        logger = _LOGGER() if log is None else _LOGGER(lambda _, *said: log(*said))
        self._callbacks = _Callbacks(logger, _ALLOCATE(), _FREE(), None, None)
        self.component = c_void_p(
            library.fmi2Instantiate(
                name, 1, guid.encode(), resources, byref(self._callbacks), 0, logging
            )
        )

    def __call__(self, function, *arguments):
        return int(getattr(self._library, f"fmi2{function}")(self.component, *arguments))


class Instance:
    """An instance; use as a context manager. Calls return the FMI status.

    Debug logging is on where a reason needs it: in an FMU that Python runs.
    """

    def __init__(self, fmu, name="instance", logging=None, logger=True):
        self.fmu = fmu
        logging = fmu.python and logger if logging is None else logging
        self.log = []
        resources, called = fmu.folder / "resources", name.encode()
        if fmu.fmi == 2:
            uri = resources.as_uri().encode()
            self._calls = _Calls(
                fmu.library, fmu.guid, uri, called, logging, self._logged if logger else None
            )
        else:
            self._calls = fmi3.Calls(
                fmu.library, fmu.guid, resources, called, logging,
                (lambda *said: self._logged(called, *said)) if logger else None,
            )  # fmt: skip
            self._calls.enumerations = fmu.enumerations
        self._component = self._calls.component
        assert self._component

    def _logged(self, instance, status, category, text):
        self.log.append(
            Logged(
                instance.decode(),
                status,
                (category or b"").decode(),
                PYTHONFMU.sub("", text.decode()),
            )
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.call("FreeInstance")

    def call(self, function, *arguments):
        """Any function, by its name without fmi2; one of FMI 3.0 where that is its counterpart."""
        return self._calls(function, *arguments)

    def setup(self, start=0.0):
        return self.call("SetupExperiment", 0, c_double(0), c_double(start), 0, c_double(0))

    def enter(self):
        return self.call("EnterInitializationMode")

    def exit(self):
        return self.call("ExitInitializationMode")

    def initialise(self, **values):
        """Set values and go through initialisation."""
        assert self.setup() == OK
        assert self.assign(values) == OK
        assert (self.enter(), self.exit()) == (OK, OK)
        return self

    def step(self, time, size):
        return self.call("DoStep", c_double(time), c_double(size), 1)

    def set(self, values):
        return self.set_real([self.fmu.references[name] for name in values], values.values())

    def assign(self, values):
        """Set variables of any type but String, type by type; the first status that is not OK."""
        for kind in ("Real", "Boolean", "Integer"):
            chosen = {n: v for n, v in values.items() if self.fmu.kinds[n] == kind}
            references = [self.fmu.references[n] for n in chosen]
            set_ = getattr(self, f"set_{kind.lower()}")
            if chosen and (status := set_(references, chosen.values())) != OK:
                return int(status)
        return OK

    def set_real(self, references, values):
        n = len(references)
        return self.call("SetReal", (c_uint * n)(*references), c_size_t(n), (c_double * n)(*values))

    def set_boolean(self, references, values):
        return self._set_whole("SetBoolean", references, values)

    def set_integer(self, references, values):
        return self._set_whole("SetInteger", references, values)

    def _set_whole(self, function, references, values):
        n = len(references)
        numbers = (c_int * n)(*map(int, values))
        return self.call(function, (c_uint * n)(*references), c_size_t(n), numbers)

    def get_real(self, references):
        n = len(references)
        values = (c_double * n)()
        return self.call("GetReal", (c_uint * n)(*references), c_size_t(n), values), list(values)

    def get_boolean(self, references):
        n = len(references)
        values = (c_int * n)()
        status = self.call("GetBoolean", (c_uint * n)(*references), c_size_t(n), values)
        return status, [bool(value) for value in values]

    def get(self, *names):
        """Values of real variables, which must be had."""
        status, values = self.get_real([self.fmu.references[name] for name in names])
        assert status == OK
        return values

    def outputs(self):
        """All real outputs."""
        return self.get(*(n for n in self.fmu.names("output") if n not in self.fmu.booleans))

    def state(self):
        """The state of now."""
        pointer = c_void_p()
        assert self.call("GetFMUstate", byref(pointer)) == OK
        return State(self, pointer)

    def restore(self, state):
        return self.call("SetFMUstate", state.pointer)

    def from_bytes(self, data):
        """The state that bytes hold."""
        pointer = c_void_p()
        buffer = (ctypes.c_char * len(data)).from_buffer_copy(data)
        status = self.call("DeSerializeFMUstate", buffer, c_size_t(len(data)), byref(pointer))
        return status, State(self, pointer)


class State:
    """An FMU state; it belongs to the instance that made it, which must free it."""

    def __init__(self, owner, pointer):
        self.owner = owner
        self.pointer = pointer

    def to_bytes(self):
        size = c_size_t()
        assert self.owner.call("SerializedFMUstateSize", self.pointer, byref(size)) == OK
        buffer = (ctypes.c_char * size.value)()
        assert self.owner.call("SerializeFMUstate", self.pointer, buffer, size) == OK
        return bytes(buffer.raw)

    def free(self):
        assert self.owner.call("FreeFMUstate", byref(self.pointer)) == OK


H = 1e-3
"""A step in s."""


def drive(instance, first, last, h=H):
    """Steps from first to last with inputs that change; returns all outputs."""
    seen = []
    for k in range(first, last):
        inputs = instance.fmu.names("input")
        scale = -2.0 if "force[1]" in inputs else 0.05
        values = {n: scale * sin(0.1 * k + i) + 0.06 for i, n in enumerate(inputs)}
        assert instance.set(values) == OK
        assert instance.step(k * h, h) == OK
        seen += instance.outputs()
    return seen
