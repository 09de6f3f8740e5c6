"""The calls of FMI 2.0 on an instance of an FMU for FMI 3.0, which has a counterpart of most.

What it logs is put as FMI 2.0 has it, so that one test serves both: names of functions and types.
"""

import ctypes
from collections.abc import Callable
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_int32, c_int64, c_size_t, c_void_p

OK, DISCARD, ERROR = 0, 2, 3

LOGGER = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)

Log = Callable[[int, bytes, bytes], None]
"""Status, category, text."""

RENAMED = {
    "GetFMUstate": "GetFMUState",
    "SetFMUstate": "SetFMUState",
    "FreeFMUstate": "FreeFMUState",
    "SerializedFMUstateSize": "SerializedFMUStateSize",
    "SerializeFMUstate": "SerializeFMUState",
    "DeSerializeFMUstate": "DeserializeFMUState",
}
SAID = {
    b"fmi3": b"fmi2",
    b"GetFMUState": b"GetFMUstate",
    b"Int32 or Int64": b"Integer",
    b"Float64": b"Real",
    b"%": b"%%",
}
"""What FMI 3.0 says, and what FMI 2.0 says; its logger is a printf."""


def as_fmi2(text):
    for ours, theirs in SAID.items():
        text = text.replace(ours, theirs)
    return text


class Calls:
    """One instance; called with the name of a function without fmi2, and its arguments."""

    def __init__(self, library, token, resources, name, on, log):
        self._library = library
        self._log = LOGGER() if log is None else LOGGER(lambda _, s, c, t: log(s, c, as_fmi2(t)))
        self._experiment = (False, 0.0, 0.0, False, 0.0)
        self._ends = c_bool()
        self.enumerations = ()
        library.fmi3InstantiateCoSimulation.restype = c_void_p
        self.component = c_void_p(
            library.fmi3InstantiateCoSimulation(
                name, token.encode(), f"{resources}/".encode(), c_bool(False), c_bool(on),
                c_bool(False), c_bool(False), None, c_size_t(0), None, self._log, None,
            )
        )  # fmt: skip

    def __call__(self, function, *arguments):
        if function[3:] in ("Real", "Integer", "Boolean", "String"):
            return self._values(function, *arguments)
        own = getattr(self, f"_{function}", None)
        return int(
            own(*arguments) if own else self._fmi3(RENAMED.get(function, function), *arguments)
        )

    def _fmi3(self, function, *arguments):
        return int(getattr(self._library, f"fmi3{function}")(self.component, *arguments))

    def _SetupExperiment(self, *arguments):
        """Part of fmi3EnterInitializationMode."""
        self._experiment = arguments
        return OK

    def _Reset(self):
        self._experiment = (False, 0.0, 0.0, False, 0.0)
        return self._fmi3("Reset")

    def _EnterInitializationMode(self):
        limited, tolerance, start, ends, stop = (getattr(a, "value", a) for a in self._experiment)
        return self._fmi3(
            "EnterInitializationMode", c_bool(limited), c_double(tolerance), c_double(start),
            c_bool(ends), c_double(stop),
        )  # fmt: skip

    def _DoStep(self, time, size, final):
        event, early, last = c_bool(True), c_bool(True), c_double()
        self._ends = c_bool(True)
        status = self._fmi3(
            "DoStep", time, size, c_bool(bool(final)),
            byref(event), byref(self._ends), byref(early), byref(last),
        )  # fmt: skip
        assert [event.value, early.value] == [False, False]
        return status

    def _GetBooleanStatus(self, _, value):
        """Whether the last step ended the simulation."""
        value._obj.value = self._ends.value
        return OK

    def _SetDebugLogging(self, on, n, categories):
        return self._fmi3("SetDebugLogging", c_bool(bool(on)), n, categories)

    def _values(self, function, references, n, values):
        """Get or set, in the type that FMI 3.0 has for it."""
        access, name = function[:3], function[3:]
        whole = references and set(references) <= set(self.enumerations)
        name, kind = {
            "Real": ("Float64", c_double),
            "Boolean": ("Boolean", c_bool),
            "Integer": ("Int64", c_int64) if whole else ("Int32", c_int32),
            "String": ("String", c_char_p),
        }[name]
        own = (kind * n.value)(*values)
        status = self._fmi3(f"{access}{name}", references, n, own, n)
        if access == "Get":
            values[:] = list(own)
        return status

    def _GetDirectionalDerivative(self, unknowns, n, knowns, m, seed, found):
        return self._fmi3("GetDirectionalDerivative", unknowns, n, knowns, m, seed, m, found, n)

    def _GetRealOutputDerivatives(self, references, n, orders, values):
        return self._fmi3("GetOutputDerivatives", references, n, orders, values, n)
