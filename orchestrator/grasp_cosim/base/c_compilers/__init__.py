"""C compilers: which there is, what decides the bits of results, and how they are run.

For the native FMUs and for the compiled loop of the master; the standard library only. What was
compiled is kept under a name made of its sources, the compiler and the flags: see cache.py.
"""

import importlib.util
import logging
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, NamedTuple

from ..interruption import SIGNALS
from ..system_calls import deferred
from . import cache

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

LOGGER = logging.getLogger(__name__)
"""Tells of each library that was compiled."""

LIBM = (
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf",
    "erfc", "exp", "exp2", "expm1", "fmod", "frexp", "hypot", "ldexp", "lgamma", "log", "log10",
    "log1p", "log2", "modf", "pow", "sin", "sinh", "tan", "tanh", "tgamma",
)  # fmt: skip
"""Functions whose calls no compiler may work out by itself: it rounds otherwise than libm."""

LEVEL = "-O3"
"""How much compilers optimise, which leaves the bits as they are."""

BITS = ("-std=c99", LEVEL, "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math")
"""What decides the bits, in addition to -fno-builtin-NAME for the functions in LIBM.

The last two leave them as they are: nobody reads errno, nor the flags of exceptions.
"""

COMPILERS = ("cc", "gcc", "clang", "cl")
"""Compilers of this machine, the first that is there, unless CC names one."""

INSTALL = shlex.join([sys.executable, "-m", "pip", "install", "ziglang"])


class CompilerError(Exception):
    """A compiler failed: of what, which, its exit code, and its first error, in one line."""


class Compiler(NamedTuple):
    """A program that compiles, with its first arguments."""

    command: tuple[str, ...]

    def __str__(self) -> str:
        """As messages call it: zig with its target, else the command."""
        words = [word for word in self.command[1:] if not word.startswith("-")]
        return " ".join([Path(self.command[0]).name, *words])

    @property
    def is_zig(self) -> bool:
        """True for zig, which makes the libraries of a target itself."""
        return Path(self.command[0]).stem.lower() == "zig"

    @property
    def identity(self) -> str:
        """What tells it from others, and from itself after an update."""
        files = [Path(program) for word in self.command if (program := shutil.which(word))]
        return repr((self.command, [(f.stat().st_size, f.stat().st_mtime_ns) for f in files]))


class Job(NamedTuple):
    """A shared library to make, of NAME.c among sources, which may include the others."""

    name: str
    sources: Mapping[str, bytes]
    compiler: Compiler
    suffix: str = ".so"
    defined: Sequence[str] = ()
    """NAME or NAME=VALUE."""
    libraries: Sequence[str] = ()
    """Options of the linker."""

    @property
    def command(self) -> list[str]:
        """What is run in a folder with the sources."""
        out = f"{self.name}{self.suffix}"
        if Path(self.compiler.command[0]).stem.lower() == "cl":
            return [
                *self.compiler.command, "/nologo", "/O2", "/fp:precise", "/MT", "/LD",
                *(f"/D{macro}" for macro in self.defined), f"{self.name}.c", f"/Fe:{out}",
            ]  # fmt: skip
        return [
            *self.compiler.command, *BITS, *(f"-fno-builtin-{function}" for function in LIBM),
            *(f"-D{macro}" for macro in self.defined), "-shared",
            *(() if self.suffix == ".dll" else ("-fPIC",)), "-o", out, f"{self.name}.c", "-lm",
            *self.libraries,
        ]  # fmt: skip

    @property
    def kept_as(self) -> str:
        """The name in the cache, made of all that decides the library."""
        sources = (part for item in sorted(self.sources.items()) for part in item)
        parts = (self.compiler.identity, sys.platform, *self.command, *sources)
        return f"compiled/{cache.key(parts)}{self.suffix}"


def find_compiler(zig_target: str = "") -> Compiler:
    """Return CC, or the first of cc, gcc, clang and cl, else zig; for a target of zig's, zig.

    ValueError, one line, where there is none.
    """
    if zig_target:
        if zig := find_zig():
            return Compiler((*zig.command, "-target", zig_target, "-s"))
        raise ValueError(f"no C compiler for {zig_target}: must be zig; {INSTALL}")
    if cc := os.environ.get("CC"):
        with suppress(ValueError):  # a quote without the other
            command = shlex.split(cc)
            if command and shutil.which(command[0]):
                return Compiler(tuple(command))
        raise ValueError(f"CC={cc}: no such program; must be a C compiler, or unset")
    if program := next(filter(shutil.which, COMPILERS), None):
        return Compiler((program,))
    if zig := find_zig():
        return zig
    raise ValueError(f"no C compiler: must be one of CC, {', '.join(COMPILERS)}, zig; {INSTALL}")


def find_zig() -> Compiler | None:
    """Return zig of the package ziglang; None without."""
    spec = importlib.util.find_spec("ziglang")
    places = spec.submodule_search_locations if spec else None
    program = shutil.which("zig", path=places[0]) if places else None
    return Compiler((program, "cc")) if program else None


def environment(scratch: Path) -> dict[str, str]:
    """Return that of a compiler which leaves nothing but in scratch, and zig's libraries, kept."""
    zig = str(cache.writable("zig") or scratch)
    folders = {"ZIG_GLOBAL_CACHE_DIR": zig, "ZIG_LOCAL_CACHE_DIR": zig, "TMPDIR": str(scratch)}
    return {**os.environ, **folders, "LC_ALL": "C"}


def compile_all(jobs: Iterable[Job], scratch: Path) -> list[Path]:
    """Return the library of each job, which is compiled in scratch where it is not kept.

    As many at once as there are processors, while the next job is waited for. What cannot be kept
    stays in scratch. CompilerError where a compiler fails; however this ends, none runs on.
    """
    from concurrent.futures import ThreadPoolExecutor  # only where something is compiled

    libraries: dict[int, Path] = {}
    with ThreadPoolExecutor(_processors()) as threads, closing(_Compiling(threads)) as compiling:
        for number, job in enumerate(jobs):
            if library := cache.kept(job.kept_as):
                libraries[number] = library
            else:
                libraries |= compiling.add(number, job, Path(mkdtemp(dir=scratch)))
        libraries |= compiling.finish()
    return [libraries[number] for number in sorted(libraries)]


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Running(NamedTuple):
    """A job that is being done; its number among all."""

    number: int
    job: Job
    process: subprocess.Popen[str]


class _Compiling:
    """Jobs that wait and jobs that run; each method returns the libraries made meanwhile.

    Before its first library for a target zig makes its own, for Windows in minutes. Other jobs for
    that target would wait for these with a processor each: they are started when the first is done.
    """

    def __init__(self, threads: "ThreadPoolExecutor") -> None:
        """The threads wait for the compilers."""
        self._threads = threads
        self._waiting: list[tuple[int, Job, Path]] = []
        self._running: dict[Future[Path], _Running] = {}
        self._ready: set[Compiler] = set()
        """Those that have made a library."""

    def add(self, number: int, job: Job, folder: Path) -> dict[int, Path]:
        """Take a job, which is done in a folder, once there is a processor for the next."""
        self._waiting.append((number, job, folder))
        self._start()
        libraries: dict[int, Path] = {}
        while len(self._running) == _processors():
            libraries |= self._wait()
            self._start()
        return libraries

    def finish(self) -> dict[int, Path]:
        """Wait for all jobs that were added."""
        libraries: dict[int, Path] = {}
        while self._running:
            libraries |= self._wait()
            self._start()
        return libraries

    def close(self) -> None:
        """End what runs."""
        for running in self._running.values():
            _end(running.process)

    def _start(self) -> None:
        """Start what can be started of the jobs that wait, in their order."""
        for entry in [*self._waiting]:
            number, job, folder = entry
            if len(self._running) < _processors() and not self._held_up(job.compiler):
                self._waiting.remove(entry)
                with deferred(SIGNALS):  # else it runs on where it was started and is not noted
                    process = _started(job, folder)
                    future = self._threads.submit(_compiled, job, process, folder)
                    self._running[future] = _Running(number, job, process)

    def _held_up(self, compiler: Compiler) -> bool:
        """True while zig is at its first library for this target."""
        first = compiler.is_zig and compiler not in self._ready
        return first and any(r.job.compiler == compiler for r in self._running.values())

    def _wait(self) -> dict[int, Path]:
        """Wait for at least one of the jobs that run."""
        from concurrent.futures import FIRST_COMPLETED, wait

        libraries: dict[int, Path] = {}
        done, _ = wait(self._running, return_when=FIRST_COMPLETED)
        for future in sorted(done, key=lambda f: self._running[f].number):
            library = future.result()
            number, job, _ = self._running.pop(future)
            libraries[number] = cache.keep(library, job.kept_as)
            self._ready.add(job.compiler)
            LOGGER.info("%s%s: compiled by %s", job.name, job.suffix, job.compiler)
        return libraries


def _started(job: Job, folder: Path) -> subprocess.Popen[str]:
    try:
        for file, data in job.sources.items():
            (folder / file).write_bytes(data)
        return subprocess.Popen(  # noqa: S603 - the user's compiler
            job.command, cwd=folder, env=environment(folder), stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
            start_new_session=True,
        )  # fmt: skip
    except OSError as error:
        reason = f"{error.filename or folder}: {error.strerror}"
        raise CompilerError(f"{job.name}.c: {reason}") from error


def _compiled(job: Job, process: subprocess.Popen[str], folder: Path) -> Path:
    output, _ = process.communicate()
    library = folder / f"{job.name}{job.suffix}"
    if process.returncode == 0 and library.is_file():
        return library
    lines = [line.strip() for line in output.splitlines() if line.strip()] or ["no message"]
    first = next((line for line in lines if re.search(r"\berror\b", line, re.I)), lines[-1])
    command = shlex.join(job.compiler.command)
    raise CompilerError(f"{job.name}.c: {command}: exit code {process.returncode}: {first}")


def _end(process: subprocess.Popen[str]) -> None:
    """End a compiler with what it has started; the thread that waits for it goes on."""
    with suppress(ProcessLookupError):
        if process.poll() is None and hasattr(os, "killpg") and hasattr(signal, "SIGKILL"):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
