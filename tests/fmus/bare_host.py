"""An FMI 2.0 host out of nothing but the standard library, to be run by any Python.

    python bare_host.py FMU FOLDER REQUEST

Extracts the FMU into the folder, runs it as REQUEST says, a JSON object with "set" (values by
name), "steps" and "step_size" (s), and prints a JSON object: every output after each step in
hexadecimal, which is every bit of it, the messages of the FMU, the files of all modules imported
since this program began, and the call that failed. The exit code is the status of that call, or 0.
"""

import sys

FIRST = set(sys.modules)
"""What Python itself has imported, with the sitecustomize of a distribution."""

# ruff: noqa: E402
import ctypes
import json
import sysconfig
import zipfile
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

WARNING, FATAL = 1, 4
CO_SIMULATION = 1

Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Callbacks(ctypes.Structure):
    """What FMI calls fmi2CallbackFunctions."""

    _fields_ = (("logger", Logger), *((name, c_void_p) for name in ("new", "free", "done", "env")))


class Failed(Exception):
    """A call gave a status that is neither OK nor Warning."""

    def __init__(self, call: str, status: int) -> None:
        super().__init__(call, status)
        self.call, self.status = call, status


class Host:
    """One instance of an FMU."""

    def __init__(self, fmu: str, folder: Path) -> None:
        with zipfile.ZipFile(fmu) as archive:
            archive.extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.variables = {v.attrib["name"]: v for v in root.iter("ScalarVariable")}
        self.messages: list[tuple[int, str]] = []
        name = root.attrib["modelName"]
        self._library = ctypes.CDLL(str(folder / "binaries" / "linux64" / f"{name}.so"))
        self._callbacks = Callbacks(Logger(self._logged))
        self._library.fmi2Instantiate.restype = c_void_p
        self._instance = c_void_p(
            self._library.fmi2Instantiate(
                b"bare",
                CO_SIMULATION,
                root.attrib["guid"].encode(),
                (folder / "resources").as_uri().encode(),
                byref(self._callbacks),
                0,
                0,
            )
        )
        if not self._instance:
            raise Failed("Instantiate", FATAL)

    def call(self, function: str, *arguments: Any) -> None:
        """Any function that returns a status, by its name without fmi2."""
        status = getattr(self._library, f"fmi2{function}")(self._instance, *arguments)
        if status > WARNING:
            raise Failed(function, status)

    def end(self) -> None:
        """Terminate and free the instance."""
        self._library.fmi2Terminate(self._instance)
        self._library.fmi2FreeInstance(self._instance)

    def set(self, name: str, value: float) -> None:
        """Set a variable."""
        kind, number, reference = self._kind(name)
        self.call(f"Set{kind}", reference, c_size_t(1), byref(number(value)))

    def get(self, name: str) -> float:
        """The value of a variable; a truth value as 0 or 1."""
        kind, number, reference = self._kind(name)
        value = number()
        self.call(f"Get{kind}", reference, c_size_t(1), byref(value))
        return float(value.value)

    def _kind(self, name: str) -> tuple[str, Any, Any]:
        variable = self.variables[name]
        reference = byref(c_uint(int(variable.attrib["valueReference"])))
        real = variable.find("Real") is not None
        return ("Real", c_double, reference) if real else ("Boolean", c_int, reference)

    def _logged(self, _: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        self.messages.append((status, text.decode()))


def run(host: Host, request: dict[str, Any]) -> dict[str, list[str]]:
    """The outputs after each step, in hexadecimal, by name."""
    host.call("SetupExperiment", 0, c_double(0.0), c_double(0.0), 0, c_double(0.0))
    host.call("EnterInitializationMode")
    for name, value in request["set"].items():
        host.set(name, value)
    host.call("ExitInitializationMode")
    outputs: dict[str, list[str]] = {
        name: [] for name, v in host.variables.items() if v.get("causality") == "output"
    }
    h = request["step_size"]
    for k in range(request["steps"]):
        host.call("DoStep", c_double(k * h), c_double(h), 0)
        for name, values in outputs.items():
            values.append(host.get(name).hex())
    return outputs


def main(fmu: str, folder: str, request: str) -> int:
    """Run, report, return the exit code."""
    host = Host(fmu, Path(folder).resolve())
    report: dict[str, Any] = {"outputs": {}, "failed": None}
    status = 0
    try:
        report["outputs"] = run(host, json.loads(request))
    except Failed as failed:
        report["failed"] = failed.call
        status = failed.status
    if status != FATAL:  # after which FMI forbids every call
        host.end()
    report["messages"] = host.messages
    report["standard_library"] = sysconfig.get_path("stdlib")
    since = (module for name, module in sys.modules.items() if name not in FIRST)
    files = (getattr(module, "__file__", None) for module in since)
    report["modules"] = sorted(str(Path(file).resolve()) for file in files if file)
    sys.stdout.write(json.dumps(report))
    sys.stdout.flush()
    return status


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
