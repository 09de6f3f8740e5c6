"""fmi2Instantiate, however a host names the resources and itself: an instance, or NULL with a line.

Each case is a process of its own:  python tests/fmus/test_odd_hosts.py CASE FMU FOLDER
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from ctypes import byref, c_double, c_void_p
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from support.fmi2 import _ALLOCATE, _FREE, _LOGGER, ERROR, OK, Fmu, _Callbacks
from support.slow import slow

Location = Callable[[str], str | None]

FOUND: dict[str, Location] = {
    "file:///abs": lambda path: f"file://{path}",
    "file:/abs": lambda path: f"file:{path}",
    "file://localhost/abs": lambda path: f"file://localhost{path}",
    "/abs": lambda path: path,
    "a slash at the end": lambda path: f"file://{path}/",
    "all encoded": lambda path: "file://" + "".join(f"%{ord(c):02x}" for c in path),
    "in capitals": lambda path: "file:///" + "".join(f"%{ord(c):02X}" for c in path[1:]),
}

NOT_FOUND: dict[str, Location] = {
    "no such folder": lambda _: "file:///no/such/folder",
    "another host": lambda path: f"file://server{path}",
    "http": lambda path: f"http://localhost{path}",
    "no path": lambda _: "file:",
    "nothing": lambda _: "",
    "NULL": lambda _: None,
    "half a code": lambda path: f"file://{path}/%",
    "no code": lambda path: f"file://{path}/%zz",
    "a NUL": lambda path: f"file://{path}%00",
    "very long": lambda path: "file://" + "/x" * 10_000,
}

NAMES: dict[str, bytes | None] = {
    "NULL name": None,
    "empty name": b"",
    "name that is no UTF-8": b"caf\xe9 \xff\xfe",
    "long name that is no UTF-8": b"\xff" * 100,
    "name of format": b"%s%n%d",
    "name of lines": b"a\nb",
    "name of 100,000": b"n" * 100_000,
}

FOLDERS = {"umlaut": "höhe", "signs": "a+b #c %25 %d"}
"""Of the FMU, percent-encoded by the host."""

CALLBACKS = ("NULL callbacks", "NULL logger", "NULL logger with logging on")

LIVES = (*FOUND, *NAMES, *FOLDERS, *CALLBACKS)


def a_sixth(cases: Iterable[str]) -> list[Any]:
    """The cases, every sixth of them in the quick tests: each starts a process."""
    return [case if i % 6 == 0 else slow(case) for i, case in enumerate(cases)]


def usual(path: str) -> str:
    return f"file://{quote(path)}"


def report(case: str, fmu: str, folder: str) -> dict[str, Any]:
    """Whether there is an instance, the statuses of its calls, and what was logged."""
    loaded = Fmu(Path(fmu), Path(folder, FOLDERS.get(case, "fmu")))
    path = str(loaded.folder / "resources")
    to_location = {**FOUND, **NOT_FOUND}.get(case, usual)
    location = "file:///no/%ff%fe" if case == "no text" else to_location(path)
    said: list[str] = []

    def log(_: Any, name: bytes, status: int, category: bytes, text: bytes) -> None:
        said.append(text.decode())

    logger = _LOGGER() if case.startswith("NULL logger") else _LOGGER(log)
    callbacks = _Callbacks(logger, _ALLOCATE(), _FREE(), None, None)
    component = loaded.library.fmi2Instantiate(
        NAMES.get(case, b"one"), 1, loaded.guid.encode(),
        None if location is None else os.fsencode(location),
        None if case == "NULL callbacks" else byref(callbacks), 0, case in (*CALLBACKS, *NAMES),
    )  # fmt: skip
    if not component:
        return {"lives": False, "said": said}

    def call(function: str, *arguments: Any) -> int:
        return int(getattr(loaded.library, f"fmi2{function}")(c_void_p(component), *arguments))

    statuses = [
        call("SetupExperiment", 0, c_double(0.0), c_double(0.0), 0, c_double(0.0)),
        call("EnterInitializationMode"), call("ExitInitializationMode"),
        call("DoStep", c_double(0.0), c_double(1e-3), 1),
        call("DoStep", c_double(9.0), c_double(1e-3), 1), call("CancelStep"),
        call("GetDirectionalDerivative", None, 0, None, 0, None, None), call("Reset"),
    ]  # fmt: skip
    loaded.library.fmi2FreeInstance(c_void_p(component))
    return {"lives": True, "said": said, "statuses": statuses}


def hosted(case: str, folder: Path, tmp_path: Path) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, __file__, case, folder / "GripperPlant.fmu", tmp_path],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    reported: dict[str, Any] = json.loads(done.stdout)
    return reported


@pytest.mark.parametrize("case", a_sixth(LIVES))
def test_an_instance_lives_where_the_meaning_is_clear(
    case: str, fmus: Path, tmp_path: Path
) -> None:
    lives(case, hosted(case, fmus, tmp_path))


def lives(case: str, found: dict[str, Any]) -> None:
    assert found["lives"]
    assert found["statuses"] == [OK, OK, OK, OK, ERROR, ERROR, ERROR, OK]
    if case not in CALLBACKS:
        assert "step from 9.0 s: must be from 0.001 s" in found["said"][0]


@pytest.mark.slow
@pytest.mark.parametrize("case", [*LIVES, *NOT_FOUND, "no text"])
def test_a_native_fmu_reads_nothing_and_lives_all_the_same(
    case: str, natives: Path, tmp_path: Path
) -> None:
    lives(case, hosted(case, natives, tmp_path))


@pytest.mark.parametrize("case", a_sixth(NOT_FOUND))
def test_without_its_resources_there_is_no_instance_but_a_line(
    case: str, fmus: Path, tmp_path: Path
) -> None:
    found = hosted(case, fmus, tmp_path)
    assert not found["lives"]
    assert len(found["said"]) == 1
    assert "the FMU's resources, which are not where the host says" in found["said"][0].replace(
        "\\", ""
    )


def test_a_folder_that_is_no_text_ends_no_host(fmus: Path, tmp_path: Path) -> None:
    """There the line comes with logging on only."""
    assert not hosted("no text", fmus, tmp_path)["lives"]


if __name__ == "__main__":
    sys.stdout.write(json.dumps(report(*sys.argv[1:])))
