"""Builds FMUs, those that Python runs and native ones, and brings folders of them up to date.

The FMUs of the blocks that come with the package are kept in the user's cache, under a key made of
all that decides them: the sources, and of native FMUs the platforms, compilers and flags. A folder
is brought up to date by copying what differs, and that takes no import of what builds.
"""

from __future__ import annotations

import atexit
import functools
import logging
import os
import re
import shutil
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from ..base.c_compilers import Compiler, CompilerError, Job, cache, compile_all, find_compiler
from ..base.platforms import elf_processor, python_processor
from .native.targets import Target, Version, folders, this_target, universal
from .package import Built, write_file
from .shipped import HANDS, PACKAGES, SHIPPED, of_fingers, package_folder, sheet_file, together

if TYPE_CHECKING:
    import zipfile

    from .package import Model

LOGGER = logging.getLogger(__name__)

Members = Mapping[str, bytes]
"""The files in an FMU, by name."""

HERE = Path(__file__).parent

_OF_BASE = ("c_compilers", "platforms.py", "si_units.py", "zip_files.py")
SOURCES = (HERE, *(HERE.parent / "base" / name for name in _OF_BASE))
"""What decides what FMUs hold, in addition to the packages that a block may import: folders and
files.
"""

VERSIONS = ("grasp_cosim-", "latex2mathml-", "markdown_it_py-", "pythonfmu-")
"""Of distributions whose versions are in FMUs, or decide what is: so their metadata is called."""

MAX_KEPT = 16
"""Builds in the cache, those used last: every change of a source makes one."""

NOT_KEPT = "%s: cannot be written to, so each process builds the FMUs; XDG_CACHE_HOME names another"

_building = threading.Lock()
"""One thread builds at a time; of several processes the first that is done has its build kept."""

_until_the_end: dict[str, Path] = {}
"""What cannot be kept, by name: folders that are there as long as this process."""

UNPREFIXED = tuple(f"FMI{fmi}_OVERRIDE_FUNCTION_PREFIX" for fmi in (2, 3))
"""What is defined for a shared library, in which functions are called as the standard does."""

NETWORKED = {".dll": ("-lws2_32",)}
"""The libraries of sockets, by the suffix of a shared library; cl is told in the C."""


class NoTwinsError(Exception):
    """There are no native FMUs here, and none can be built: why, and what helps, in one line."""


class Plan(NamedTuple):
    """Which binaries an FMU gets: by target its folder and its compiler."""

    fmi: Version
    places: Mapping[Target, str]
    compilers: Mapping[Target, Compiler]
    note: str
    """The note on the folders, or ""."""

    @property
    def key(self) -> str:
        """A hash of all that decides the binaries, but for the sources."""
        identities = [compiler.identity for compiler in self.compilers.values()]
        return cache.key([repr((self.fmi, *self.places.items(), *identities))])


def planned(requested: Sequence[Target] = (), fmi: Version = 2) -> Plan:
    """Return the plan for this machine and the targets asked for.

    ValueError, one line, where there is no compiler for one of them.
    """
    places, note = folders(requested, fmi)
    return Plan(fmi, places, {t: compiler_for(t, t in requested) for t in places}, note)


def compiler_for(target: Target, requested: bool) -> Compiler:
    """Return the compiler for a target; ValueError where there is none, with what to install.

    Where the target was asked for by name, to go to machines with an older libc, it is zig.
    """
    return find_compiler("" if target == this_target() and not requested else target.zig)


def build(out: Path) -> list[Built]:
    """Build the FMUs that Python runs into the folder `out`, with their cross-check files.

    A file that is there with the same content is left out.
    """
    return _brought(out, shipped_fmus())


def build_native(out: Path, plan: Plan | None = None, names: Sequence[str] = ()) -> list[Built]:
    """Build native FMUs into the folder `out`, with their cross-check files; by default all.

    ValueError, one line, for a name that is none, or where a compiler is missing;
    CompilerError where one fails.
    """
    return _brought(out, _cached(chosen_names(names), plan or planned()))


def build_block(file: Path, out: Path, plan: Plan | None = None) -> Built:
    """Build the FMU of the block in a file into the folder out: spring_plant.py, SpringPlant.fmu.

    With a plan it is native. ValueError, one line, where the file is no block, see own_model().
    """
    from .own_block import own_model

    with own_model(file) as model:
        return build_model(model, out, plan)


def kept_block(file: Path) -> Path:
    """The FMU of the block in a file, from the cache where it was built of the same file.

    ValueError, one line, where the file is no block, see own_model(); OSError where it is none.
    """
    name = f"fmus/{cache.key((sources_key(), 'block', file.name, file.read_bytes()))}"

    def make(folder: Path) -> None:
        build_block(file, folder)

    with _building:
        folder = cache.kept(name) or _until_the_end.get(name) or _build_kept(make, name)
    return next(folder.glob("*.fmu"))


def build_chosen(
    block: Path | None, out: Path, plan: Plan | None = None, fingers: int | None = None
) -> list[Built]:
    """Build the FMUs of all blocks that come with the package, or of one, into the folder `out`.

    block is a Python file; with a plan, which makes them native, also the name of one of our own.
    With `fingers` the FMUs are those of a hand that has so many. ValueError, one line, where there
    is no such block, or a compiler is missing; CompilerError where one fails.
    """
    if block and not (plan and names_ours(block)):
        return [build_block(block, out, plan)]
    names = [str(block)] if block else of_fingers(fingers) if fingers is not None else []
    return build_native(out, plan, names) if plan else _brought(out, shipped_fmus(fingers), names)


def names_ours(block: Path) -> bool:
    """Return True where it is to be the name of a block of the package, and not a file."""
    return block.suffix == "" and block.name == str(block) and not block.exists()


def write_c_only(block: Path | None, out: Path, a2l: bool = False) -> list[Path]:
    """Write the C of one block into the folder `out`, of all into folders in it.

    With `a2l` what measures and calibrates them by XCP comes along. block is as in build_chosen();
    return the files. ValueError, one line, where there is none.
    """
    from .native.c_only import write_c
    from .own_block import own_model
    from .package import shipped_model

    if block and not names_ours(block):
        with own_model(block) as model:
            return write_c(out, model, a2l)
    names = chosen_names([str(block)] if block else [])
    places = [(shipped_model(name), out if block else out / name) for name in names]
    return [path for model, place in places for path in write_c(place, model, a2l)]


def build_model(model: Model, out: Path, plan: Plan | None = None) -> Built:
    """Build the FMU of a model into the folder `out`, without cross-check files."""
    from .package import write_members

    name = model.description.name
    if plan and model.requires:
        raise ValueError(f"{name}: stays Python only, as it needs {', '.join(model.requires)}")
    return write_members(out / f"{name}.fmu", _members([model], plan)[name])


def _members(models: Iterable[Model], plan: Plan | None) -> dict[str, Members]:
    from .package import python_members

    if not plan:
        return {model.description.name: python_members(model)[1] for model in models}
    from .native.sources import native_members

    fmi = plan.fmi
    return with_binaries(((m.description.name, native_members(m, fmi)) for m in models), plan)


def chosen_names(names: Sequence[str] = ()) -> list[str]:
    """Return these names of blocks that come with the package, by default all.

    ValueError, one line, for one that is none.
    """
    for name in names:
        if together(name) is None:
            valid = f"must be of {', '.join(SHIPPED)}, {HANDS}, or a file NAME.py"
            raise ValueError(f"{name}: no such block; {valid}")
    return [*names] or [*SHIPPED]


def with_binaries(
    fmus: Iterable[tuple[str, Members]], plan: Plan, networked: bool = False
) -> dict[str, Members]:
    """Return the FMUs by name with their binaries; those of one place become one for all.

    Each is compiled while the next is waited for. `networked` ones are linked with what sockets
    need.
    """
    complete: dict[str, Members] = {}

    def jobs() -> Iterator[Job]:
        for name, files in fmus:
            complete[name] = files
            below = ((n.partition("sources/")[2], data) for n, data in files.items())
            sources = {n: data for n, data in below if n}
            for target, compiler in plan.compilers.items():
                yield job(name, sources, target, compiler, networked)

    with TemporaryDirectory(prefix="fmu_export_") as scratch:
        libraries = iter([library.read_bytes() for library in compile_all(jobs(), Path(scratch))])
    for name, files in complete.items():
        binaries_by_place: dict[str, list[bytes]] = {}
        for target in plan.compilers:
            place = f"binaries/{plan.places[target]}/{name}{target.suffix}"
            binaries_by_place.setdefault(place, []).append(next(libraries))
        binaries = {place: parts[0] if len(parts) == 1 else universal(parts)
                    for place, parts in binaries_by_place.items()}  # fmt: skip
        complete[name] = {**files, **binaries}
    return complete


def job(
    name: str, sources: Members, target: Target, compiler: Compiler, networked: bool = False
) -> Job:
    """Return what makes the library of an FMU, in which functions are called as in the standard."""
    libraries = NETWORKED.get(target.suffix, ()) if networked else ()
    return Job(name, sources, compiler, target.suffix, UNPREFIXED, libraries)


# ------------------------------------------------------------------ what is kept


def sources_key() -> str:
    """Return a key of all that decides what the FMUs and the files next to them hold.

    That is our packages and cards, pythonfmu's binaries, versions, and that of Python.
    """
    site = package_folder("pythonfmu")
    files = [*_below(site / "resources" / "binaries"), *map(sheet_file, PACKAGES)]
    for source in (*map(package_folder, PACKAGES), *SOURCES):
        files += _below(source) if source.is_dir() else [source]
    versions = sorted(name for name in os.listdir(site.parent) if name.startswith(VERSIONS))  # noqa: PTH208
    states = ((f, f.stat()) for f in files if f.is_file())
    return _key_of(tuple(versions), tuple((f, s.st_size, s.st_mtime_ns) for f, s in states))


@functools.lru_cache(maxsize=1)
def _key_of(versions: tuple[str, ...], files: tuple[tuple[Path, int, int], ...]) -> str:
    """Return the key of files as they are: the Python FMUs of a run and their twins ask for it."""
    contents = (part for f, *_ in files for part in (f.name, f.read_bytes()))
    return cache.key((sys.version, *versions, *contents))


def _below(folder: Path) -> list[Path]:
    """Return the files below a folder, but for what Python makes there."""
    files = []
    for place, below, names in os.walk(folder):
        below[:] = sorted(name for name in below if name != "__pycache__")
        files += [Path(place, name) for name in sorted(names)]
    return files


def _cached(names: Sequence[str], plan: Plan | None = None) -> Path:
    """Return the folder with these FMUs, from the cache where they were built of the same parts.

    Where nothing can be kept it ends with this process, which a warning says.
    """
    parts = ("native", plan.key) if plan else ("python",)
    name = f"fmus/{cache.key((sources_key(), *parts, *names))}"
    with _building:
        if kept := cache.kept(name):
            with suppress(OSError):  # of another user
                os.utime(kept)
            return kept
        return _until_the_end.get(name) or _build_kept(partial(_fill, names, plan), name)


def _fill(names: Sequence[str], plan: Plan | None, folder: Path) -> None:
    from .cross_check import cross_check_files
    from .package import shipped_model, write_members

    def models() -> Iterator[Model]:
        for model in map(shipped_model, names):
            yield model
            for file, data in cross_check_files(model.description.name, model.block).items():
                (folder / file).write_bytes(data)

    for name, files in _members(models(), plan).items():
        write_members(folder / f"{name}.fmu", files)


def _build_kept(make: Callable[[Path], None], name: str) -> Path:
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(TemporaryDirectory(prefix="fmu_export_")))
        make(scratch)
        folder = cache.keep(scratch, name)
        if folder == scratch:
            if not _until_the_end:  # said once
                LOGGER.warning(NOT_KEPT, cache.folder() or "the user's cache")
            atexit.register(stack.pop_all().close)
            _until_the_end[name] = scratch
            return scratch
    with suppress(OSError):  # another process does so, too
        for outdated in sorted(folder.parent.iterdir(), key=lambda f: f.stat().st_mtime)[
            :-MAX_KEPT
        ]:
            shutil.rmtree(outdated)
    return folder


def _brought(out: Path, source: Path, names: Sequence[str] = ()) -> list[Built]:
    """Bring the folder `out` up to date with one that was made; return its FMUs, or these names."""
    built = []
    for file in sorted(source.iterdir()):
        if names and not re.fullmatch(rf"({'|'.join(names)})[._].*", file.name):
            continue
        brought = write_file(out / file.name, file.read_bytes())
        built += [brought] if file.suffix == ".fmu" else []
    return built


# ------------------------------------------------------------------ twins


def shipped_fmus(fingers: int | None = None) -> Path:
    """The folder of the FMUs of the blocks that come with the package, built if need be.

    With `fingers` those of a hand that has so many are next to them. Threads and processes may ask
    at the same time. ValueError for a number of fingers that there is not.
    """
    names = [*SHIPPED, *(of_fingers(fingers) if fingers is not None else ())]
    return _cached(names)


@functools.cache
def shipped_twins(names: tuple[str, ...]) -> Path:
    """The folder of the native FMUs of blocks that come with the package, built if need be.

    NoTwinsError where they cannot be built.
    """
    try:
        return _cached(names, planned())
    except (ValueError, CompilerError) as error:
        raise NoTwinsError(str(error)) from error
    except OSError as error:
        raise NoTwinsError(f"{error.filename}: {error.strerror}") from error


def is_twin(fmu: Path, content: str) -> bool:
    """Return True for a native FMU that runs here, and whose Python twin has this content hash.

    It says so in its sources.
    """
    with suppress(OSError):
        return _is_twin(fmu, fmu.stat().st_mtime_ns, content)
    return False


@functools.lru_cache(maxsize=1024)
def _is_twin(fmu: Path, _: int, content: str) -> bool:
    """As is_twin(), of a file as it was changed last; a thousand runs open it once."""
    import zipfile

    with suppress(Exception), zipfile.ZipFile(fmu) as archive:  # it may be damaged in any way
        definition = f'#define CONTENT "{content}"'.encode()
        sources = [n for n in archive.namelist() if n.startswith("sources/") and n.endswith(".c")]
        return any(definition in archive.read(name) for name in sources) and _runs_here(archive)
    return False


def _runs_here(archive: zipfile.ZipFile) -> bool:
    """Return True if a binary is for this machine: linux64 may hold one for another processor."""
    folders_of_here = tuple(
        f"binaries/{name}/" for name in (this_target().folder, this_target().tuple)
    )
    binaries = [name for name in archive.namelist() if name.startswith(folders_of_here)]
    return any(elf_processor(archive.read(name)) == python_processor() for name in binaries)
