"""Compiles the C of native FMUs: with the compiler of this machine, for others with zig.

What was compiled is kept in a folder of the user, under a hash of all that decides it.
"""

import importlib.util
import os
import re
import shlex
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from ..folder import write_file
from .targets import Target, here

LIBM = (
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf",
    "erfc", "exp", "exp2", "expm1", "fmod", "frexp", "hypot", "ldexp", "lgamma", "log", "log10",
    "log1p", "log2", "modf", "pow", "sin", "sinh", "tan", "tanh", "tgamma",
)  # fmt: skip
"""Functions whose calls no compiler may work out by itself: it rounds otherwise than libm."""

BITS = ("-std=c99", "-O2", "-ffp-contract=off")
"""What decides the bits, besides -fno-builtin-NAME for the functions in LIBM."""

ZIG_CACHES = "ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"
"""Where zig keeps its libraries, and what it has compiled."""

UNPREFIXED = tuple(f"FMI{fmi}_OVERRIDE_FUNCTION_PREFIX" for fmi in (2, 3))
"""What is defined for a shared library, in which functions are called as the standard does."""


NETWORKED = {".so": ("-lpthread", "-ldl"), ".dll": ("-lws2_32",)}
"""The libraries of sockets and threads, by the suffix of a shared library; cl is told in the C."""


class CompilerError(Exception):
    """A compiler failed: which, its exit code, and its first error, in one line."""


class Compiler(NamedTuple):
    """A program that compiles, and what tells it from others."""

    command: tuple[str, ...]
    identity: str
    environment: Mapping[str, str] = {}

    def line(self, name: str, target: Target, networked: bool = False) -> list[str]:
        """Return the command that makes NAME.c, in the current folder, a shared library.

        One that is networked is linked with what its sockets need.
        """
        out = f"{name}{target.suffix}"
        libraries = NETWORKED.get(target.suffix, ()) if networked else ()
        if Path(self.command[0]).stem.lower() == "cl":
            defined = [f"/D{macro}" for macro in UNPREFIXED]
            return [
                *self.command, "/nologo", "/O2", "/fp:precise", "/MT", "/LD", *defined,
                f"{name}.c", f"/Fe:{out}",
            ]  # fmt: skip
        return [
            *self.command, *BITS, *(f"-fno-builtin-{function}" for function in LIBM),
            *(f"-D{macro}" for macro in UNPREFIXED), "-fvisibility=hidden", "-shared",
            *(() if target.suffix == ".dll" else ("-fPIC",)), "-o", out, f"{name}.c", "-lm",
            *libraries,
        ]  # fmt: skip


class Job(NamedTuple):
    """A shared library to make: of NAME.c among sources, for a target."""

    sources: Mapping[str, bytes]
    name: str
    target: Target
    compiler: Compiler
    networked: bool = False

    @property
    def key(self) -> str:
        """A hash of all that decides the library."""
        digest = sha256(repr((self.compiler.identity, self.line, self.target)).encode())
        for file, data in sorted(self.sources.items()):
            digest.update(f"\0{file}\0{len(data)}\0".encode() + data)
        return digest.hexdigest()[:32]

    @property
    def line(self) -> list[str]:
        """The command."""
        return self.compiler.line(self.name, self.target, self.networked)


def compile_all(jobs: Sequence[Job]) -> list[bytes]:
    """Return the shared library of each job, made now, as many at once as there are processors.

    What was made before comes from the user's folder, if it is whole; what cannot be kept there is
    made again the next time. CompilerError where a compiler fails.
    """
    keys = [job.key for job in jobs]
    kept = cache_folder()
    folder = kept / "native" if kept else None
    found = {key: data for key in keys if folder and (data := _read(folder / key)) is not None}
    missing = {key: job for key, job in zip(keys, jobs, strict=True) if key not in found}
    for key, data in zip(missing, _compiled(missing.values()), strict=True):
        found[key] = data
        if folder:
            with suppress(OSError):
                write_file(folder / key, sha256(data).digest() + data)
    return [found[key] for key in keys]


def _read(file: Path) -> bytes | None:
    """Return what is kept in a file, behind its check sum; None where there is none, or damaged."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    check, data = content[: sha256().digest_size], content[sha256().digest_size :]
    return data if check == sha256(data).digest() else None


class _Running(NamedTuple):
    job: Job
    folder: Path
    process: subprocess.Popen[bytes]


def _compiled(jobs: Iterable[Job]) -> list[bytes]:
    """Return the libraries of jobs, in their order; however this ends, no compiler runs on."""
    most = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    waiting, running, done = deque(jobs), deque[_Running](), []

    def start(job: Job) -> None:
        running.append(_started(job, Path(tempfile.mkdtemp(dir=scratch))))

    # Ctrl-C comes to the main thread alone: what another one starts is in the list, too.
    with _scratch_folder() as scratch, ThreadPoolExecutor(1) as starter:
        try:
            while waiting or running:
                while waiting and len(running) < most:
                    starter.submit(start, waiting.popleft()).result()
                done.append(_result(running[0]))
                running.popleft()
        finally:
            starter.shutdown()
            for started in running:
                _end(started.process)
    return done


@contextmanager
def _scratch_folder() -> Iterator[str]:
    """Make a temporary folder; what a kill leaves of it, the next command of grasp-cosim removes.

    That knows it by its name, and by its lock whether its process still runs.
    """
    if sys.platform == "win32":
        with tempfile.TemporaryDirectory(prefix="grasp_scratch_") as folder:
            yield folder
        return
    import fcntl

    made = Path(tempfile.mkdtemp(prefix="grasp_fmus_"))
    folder = str(made.with_name(made.name.replace("fmus", "scratch", 1)))
    lock = os.open(made, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(lock, fcntl.LOCK_EX)
        made.rename(folder)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _started(job: Job, folder: Path) -> _Running:
    try:
        for file, data in job.sources.items():
            (folder / file).write_bytes(data)
    except OSError as error:
        raise CompilerError(
            f"{job.name}.c cannot be written to {folder}: {error.strerror}; must have room there, "
            "or TMPDIR must be another folder"
        ) from error
    own = dict.fromkeys(("TMPDIR", *ZIG_CACHES), str(folder))
    environment = {**os.environ, **own, "LC_ALL": "C", **job.compiler.environment}
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(  # noqa: S603 - the user's compiler
            job.line, cwd=folder, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
            env=environment, start_new_session=True,
        )  # fmt: skip
    return _Running(job, folder, process)


def _result(running: _Running) -> bytes:
    code = running.process.wait()
    job, file = running.job, running.folder / f"{running.job.name}{running.job.target.suffix}"
    if code == 0 and file.is_file():
        return file.read_bytes()
    lines = (running.folder / "said").read_text("utf-8", "replace").splitlines()
    said = [line.strip() for line in lines if line.strip()] or ["no message"]
    errors = (line for line in said if re.search(r"\berror\b", line, re.IGNORECASE))
    text = f"{shlex.join(job.compiler.command)}: exit code {code}: {next(errors, said[-1])}"
    raise CompilerError(f"{job.name}.c for {job.target.tuple}: {text}")


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a compiler with what it has started."""
    if process.poll() is None:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
        process.wait()


def compiler_for(target: Target, asked: bool) -> Compiler:
    """Return the compiler for a target; ValueError where there is none, with what to install.

    For this machine that is CC, or the first of cc, gcc, clang and cl, else zig. For others, and
    where the target was asked for by name, to go to machines with an older libc, it is zig.
    """
    if target == here() and not asked:
        own = _own_compiler()
        if own:
            return own
    zig = zig_compiler()
    if zig and target.zig:
        return zig._replace(command=(*zig.command, "-target", target.zig, "-s"))
    install = shlex.join([sys.executable, "-m", "pip", "install", "ziglang"])
    needed = "one of CC, cc, gcc, clang, zig" if target == here() and not asked else "zig"
    raise ValueError(f"no C compiler for {target.tuple}: must be {needed}; {install}")


def _own_compiler() -> Compiler | None:
    given = os.environ.get("CC")
    if given:
        try:
            command = shlex.split(given)
        except ValueError:
            command = []
        if not command or not shutil.which(command[0]):
            raise ValueError(f"CC={given}: no such program; must be a C compiler, or unset")
        return _identified(command)
    found = next(filter(shutil.which, ("cc", "gcc", "clang", "cl")), None)
    return _identified([found]) if found else None


def zig_compiler() -> Compiler | None:
    """Return zig of the package ziglang, with its own folder for what it makes; None without."""
    spec = importlib.util.find_spec("ziglang")
    places = spec.submodule_search_locations if spec else None
    program = shutil.which("zig", path=places[0]) if places else None
    if not program:
        return None
    kept = cache_folder()
    folder = str(kept / "zig") if kept and can_write(kept / "zig") else ""
    return _identified([program, "cc"], dict.fromkeys(ZIG_CACHES if folder else (), folder))


def _identified(command: Sequence[str], environment: Mapping[str, str] | None = None) -> Compiler:
    """Return the compiler with what it says of itself; cl does so whatever it is asked."""
    asked = [*command, *([] if Path(command[0]).stem.lower() == "cl" else ["--version"])]
    try:
        said = subprocess.run(  # noqa: S603 - the user's compiler
            asked, stdin=subprocess.DEVNULL, capture_output=True, check=False,
            env={**os.environ, **(environment or {})},
        )  # fmt: skip
    except OSError as error:
        raise ValueError(f"{command[0]}: does not start: {error.strerror}") from error
    identity = (said.stdout or said.stderr).decode("utf-8", "replace")
    return Compiler(tuple(command), identity, environment or {})


def cache_folder() -> Path | None:
    """Return the folder of the user for what can be made again; None where there can be none.

    A relative path, which would be another folder in each, does not count, as the standard has it.
    """
    with suppress(RuntimeError):  # nobody's home
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else Path.home() / ".cache"
        return base / "grasp-cosim" if base.is_absolute() else None
    return None


def can_write(folder: Path) -> bool:
    """Return True if the folder is there, or can be made, and written to."""
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        return os.access(folder, os.W_OK)
    return False


def universal(thin: Sequence[bytes]) -> bytes:
    """Return libraries for processors of macOS as one that serves them all."""
    page = 1 << 14
    head, body, place = struct.pack(">II", 0xCAFEBABE, len(thin)), b"", page
    for binary in thin:
        processor = struct.unpack_from("<II", binary, 4)
        head += struct.pack(">5I", *processor, place, len(binary), 14)
        body += binary + bytes(-len(binary) % page)
        place = page + len(body)
    return head + bytes(page - len(head)) + body
