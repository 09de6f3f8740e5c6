"""Compilers: found or named as missing, heard when they fail, ended with us, asked once."""

import ctypes
import errno
import os
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from grasp_cosim import scratch
from grasp_fmus.native import compilers
from grasp_fmus.native.compilers import (
    Compiler,
    CompilerError,
    Job,
    _scratch_folder,
    cache_folder,
    compile_all,
    compiler_for,
    universal,
)  # fmt: skip
from grasp_fmus.native.targets import LINUX_ARM, LINUX_X86, MAC_ARM, MAC_X86, WINDOWS, Target, here
from support.compilers import needs_zig
from support.native_fmus import needs_gcc
from support.processes import ends

SOURCES = {
    "Sum.c": b'#include "terms.h"\n__attribute__((visibility("default"))) int sum(void)'
    b" { return hidden(); }\n",
    "terms.h": b"static int hidden(void) { return 40 + 2; }\n",
}
HOUR = '#!/bin/sh\nif [ "$1" = --version ]; then echo 1; else sleep 3600 & echo $! > {}; wait; fi\n'

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="NO Linux")


@pytest.fixture(autouse=True)
def _own_cache(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty one, but for zig, which would make its libraries anew."""
    if "zig" not in request.node.name:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)


def program(path: Path, text: str) -> Path:
    """A program that says 1 when it is asked for its version, and is a compiler otherwise."""
    path.write_text(text)
    path.chmod(0o755)
    return path


def library_of(sources: Mapping[str, bytes]) -> bytes:
    (library,) = compile_all([Job(sources, "Sum", here(), compiler_for(here(), asked=False))])
    return library


@needs_gcc
def test_compiles_one_file_that_includes_the_others(tmp_path: Path) -> None:
    (tmp_path / "sum.so").write_bytes(library_of(SOURCES))
    assert ctypes.CDLL(str(tmp_path / "sum.so")).sum() == 42


@needs_gcc
def test_the_same_sources_give_the_same_bytes() -> None:
    job = Job(SOURCES, "Sum", here(), compiler_for(here(), asked=False))
    first, second = compilers._compiled([job, job])
    assert first == second


def counting(tmp_path: Path, log: Path) -> str:
    """A compiler that is cc and counts its work."""
    text = f'#!/bin/sh\ncase "$*" in *--version) ;; *) echo >> {log};; esac\nexec gcc "$@"\n'
    return str(program(tmp_path / "counting", text))


@needs_gcc
def test_nothing_is_compiled_twice_unless_something_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log"
    monkeypatch.setenv("CC", counting(tmp_path, log))
    changed = {**SOURCES, "terms.h": SOURCES["terms.h"].replace(b"2", b"3")}
    for sources, runs in ((SOURCES, 1), (SOURCES, 1), (changed, 2), (SOURCES, 2)):
        library_of(sources)
        assert len(log.read_text().splitlines()) == runs
    monkeypatch.setenv("CC", f"{os.environ['CC']} -O1")
    library_of(SOURCES)
    assert len(log.read_text().splitlines()) == 3


@needs_gcc
@pytest.mark.parametrize("place", ["/dev/null", "/proc"], ids=["a file", "read-only"])
def test_works_where_nothing_can_be_kept(place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", place)
    assert library_of(SOURCES)[:4] == b"\x7fELF"


@needs_zig
@pytest.mark.platforms
def test_zig_needs_no_folder_to_keep_its_libraries_in(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Its own default is below the same folder, and it stops where that cannot be written to."""
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    monkeypatch.chdir(tmp_path)
    library = compile_all([Job(SOURCES, "Sum", here(), compiler_for(here(), asked=True))])[0]
    assert library[:4] == b"\x7fELF"
    assert not list(tmp_path.iterdir())


def test_a_relative_folder_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would be another one in each folder, and lost in that where a compiler runs."""
    monkeypatch.setenv("XDG_CACHE_HOME", "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache/grasp-cosim"
    monkeypatch.setenv("HOME", "there")
    assert cache_folder() is None


@needs_gcc
@pytest.mark.parametrize("damage", [lambda b: b[:3000], lambda b: b[:-1] + b"?", lambda b: b""])
def test_what_is_damaged_is_made_again(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    """A kill or a full disk may have cut it; nobody is to get it in an FMU."""
    library = library_of(SOURCES)
    (kept,) = (tmp_path / "cache/grasp-cosim/native").iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(damage(whole))
    assert library_of(SOURCES) == library
    assert kept.read_bytes() == whole


@pytest.mark.parametrize("given", ["cc 'half a quote", "   "])
def test_a_compiler_that_is_none_is_named(given: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", given)
    with pytest.raises(ValueError, match=rf"^CC={given}: no such program; must be a C compiler"):
        compiler_for(here(), asked=False)


@needs_gcc
def test_a_full_temporary_folder_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    job = Job(SOURCES, "Sum", here(), compiler_for(here(), asked=False))
    monkeypatch.setattr(Path, "write_bytes", full)
    line = r"^Sum.c cannot be written to /.*grasp_scratch_.*: No space left on device; must have"
    with pytest.raises(CompilerError, match=line):
        compile_all([job])


def test_a_missing_compiler_is_named_with_its_fix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(compilers, "zig_compiler", lambda: None)
    fix = f"{sys.executable} -m pip install ziglang"
    one = "one of CC, cc, gcc, clang, zig"
    for target, asked, needed in (
        (here(), False, one),
        (here(), True, "zig"),
        (WINDOWS, True, "zig"),
    ):
        with pytest.raises(ValueError, match=r"^no C") as error:
            compiler_for(target, asked)
        said = f"no C compiler for {target.tuple}: must be {needed}; {fix}"
        assert str(error.value) == said


def test_cc_must_be_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(ValueError, match="CC=no-such-compiler -m64: no such program; must be a C"):
        compiler_for(here(), asked=False)


def test_a_compiler_that_does_not_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", str(program(tmp_path / "cc", "#!/no/such/shell\n")))
    with pytest.raises(ValueError, match="does not start: No such file or directory"):
        compiler_for(here(), asked=False)


@pytest.mark.parametrize(
    ("said", "code", "line"),
    [
        (
            "In file x:\nM.c:3:1: error: expected ';'\nerror: 2 more",
            1,
            "M.c:3:1: error: expected ';'",
        ),
        ("cannot go on", 7, "cannot go on"),
        ("", 3, "no message"),
        ("", 0, "no message"),
    ],
)
def test_a_compiler_that_fails_is_heard_in_one_line(
    said: str, code: int, line: str, tmp_path: Path
) -> None:
    text = f"#!/bin/sh\nprintf '%s' \"{said}\" >&2\nexit {code}\n"
    compiler = Compiler((str(program(tmp_path / "cc", text)),), "1")
    with pytest.raises(CompilerError) as error:
        compile_all([Job(SOURCES, "Sum", LINUX_X86, compiler)])
    assert str(error.value) == (
        f"Sum.c for x86_64-linux: {tmp_path}/cc: exit code {code}: {line}"
    )  # fmt: skip
    assert not (tmp_path / "cache/grasp-cosim/native").exists()


def test_a_compiler_that_has_just_started_ends_with_us(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C that comes while a compiler is being started does not lose it."""
    begin, begun, heard = compilers._started, [], threading.Event()

    def interrupt(*_: object) -> None:
        heard.set()
        raise KeyboardInterrupt

    def slowly(job: Job, folder: Path) -> compilers._Running:
        running = begin(job, folder)
        begun.append(running.process)
        os.kill(os.getpid(), signal.SIGINT)
        assert heard.wait(60.0)
        return running

    monkeypatch.setattr(compilers, "_started", slowly)
    compiler = Compiler((str(program(tmp_path / "cc", "#!/bin/sh\nexec sleep 3600\n")),), "1")
    before = signal.signal(signal.SIGINT, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            compile_all([Job(SOURCES, "Sum", LINUX_X86, compiler)])
    finally:
        signal.signal(signal.SIGINT, before)
    assert [process.returncode for process in begun] == [-signal.SIGKILL]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_no_compiler_outlives_us(number: signal.Signals, tmp_path: Path) -> None:
    """Nor what it has started, nor its files."""
    pid = tmp_path / "pid"
    compiler = str(program(tmp_path / "cc", HOUR.format(pid)))
    command = [sys.executable, "-m", "grasp_cosim", "build", "--native", "--out", "out"]
    environment = {
        **os.environ, "CC": compiler, "PYTHONPATH": os.pathsep.join(sys.path),
        "TMPDIR": str(tmp_path),
    }  # fmt: skip
    us = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    end = time.monotonic() + 60.0
    while not (pid.exists() and pid.read_text()) and time.monotonic() < end:
        time.sleep(0.05)
    child = int(pid.read_text())
    us.send_signal(number)
    _, said = us.communicate(timeout=60.0)
    assert (us.returncode, said.strip()) == (
        130 if number == signal.SIGINT else 143,
        "grasp-cosim: interrupted",
    )
    assert ends(child)
    assert not (tmp_path / "out").exists()
    assert not list(tmp_path.glob("grasp_*"))


def test_what_a_kill_leaves_the_next_command_removes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    killed = (
        "import os, signal\nfrom grasp_fmus.native.compilers import _scratch_folder\n"
        "with _scratch_folder():\n    os.kill(os.getpid(), signal.SIGKILL)"
    )
    with _scratch_folder() as ours:
        environment = {**os.environ, "TMPDIR": str(tmp_path)}
        subprocess.run([sys.executable, "-c", killed], check=False, env=environment)
        assert len(list(tmp_path.iterdir())) == 2
        scratch.sweep(str(tmp_path))
        assert [str(path) for path in tmp_path.iterdir()] == [ours]
    assert not list(tmp_path.iterdir())


def test_one_library_for_both_processors_of_macos() -> None:
    """Mach-O files are told apart by their processor; each begins on a page."""
    thin = [struct.pack("<III", 0xFEEDFACF, cpu, sub) + bytes(n) for cpu, sub, n in
            ((0x01000007, 3, 5), (0x0100000C, 0, 20_000))]  # fmt: skip
    fat = universal(thin)
    magic, count = struct.unpack_from(">II", fat)
    assert (magic, count) == (0xCAFEBABE, 2)
    for i, binary in enumerate(thin):
        cpu, sub, place, size, align = struct.unpack_from(">5I", fat, 8 + 20 * i)
        assert (cpu, sub) == struct.unpack_from("<II", binary, 4)
        assert (place % (1 << align), fat[place : place + size]) == (0, binary)


@needs_zig
@pytest.mark.platforms
@pytest.mark.parametrize("target", [LINUX_X86, LINUX_ARM, MAC_X86, MAC_ARM])
def test_zig_compiles_for_others(target: Target) -> None:
    magic = b"\x7fELF" if target.suffix == ".so" else struct.pack("<I", 0xFEEDFACF)
    job = Job(SOURCES, "Sum", target, compiler_for(target, asked=True))
    first, second = compilers._compiled([job, job])
    assert first[:4] == magic
    assert first == second
