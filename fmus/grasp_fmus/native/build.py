"""Builds native FMUs: those of the blocks that come with the package, or of one of your own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from c_compilers import Compiler, Job, compile_all, find_compiler

from ..folder import Built, is_current, sources_hash, write_file, write_stamp
from ..shipped import SCRIPTS, slave_class
from .targets import Target, Version, folders, here, universal

if TYPE_CHECKING:
    from ..package import Model

Members = Mapping[str, bytes]
"""The files in an FMU, by name."""


UNPREFIXED = tuple(f"FMI{fmi}_OVERRIDE_FUNCTION_PREFIX" for fmi in (2, 3))
"""What is defined for a shared library, in which functions are called as the standard does."""

NETWORKED = {".so": ("-lpthread", "-ldl"), ".dll": ("-lws2_32",)}
"""The libraries of sockets and threads, by the suffix of a shared library; cl is told in the C."""


class Plan(NamedTuple):
    """Which binaries an FMU gets: by target its folder and its compiler."""

    fmi: Version
    places: Mapping[Target, str]
    compilers: Mapping[Target, Compiler]
    note: str
    """What is to be said of the folders, or ""."""

    @property
    def key(self) -> str:
        """A hash of all that decides the binaries, but for the sources."""
        known = [
            (self.fmi, *item, self.compilers[item[0]].identity) for item in self.places.items()
        ]
        return sha256(repr(known).encode()).hexdigest()


def planned(asked: Sequence[Target] = (), fmi: Version = 2) -> Plan:
    """Return the plan for this machine and the targets asked for.

    ValueError, one line, where there is no compiler for one of them.
    """
    places, note = folders(asked, fmi)
    return Plan(fmi, places, {t: compiler_for(t, t in asked) for t in places}, note)


def compiler_for(target: Target, asked: bool) -> Compiler:
    """Return the compiler for a target; ValueError where there is none, with what to install.

    Where the target was asked for by name, to go to machines with an older libc, it is zig.
    """
    return find_compiler("" if target == here() and not asked else target.zig)


def python_only() -> dict[str, str]:
    """Why a block that comes with the package cannot be native, by its name."""
    return {
        name: f"{name}: stays Python only, as it needs {', '.join(requires)}"
        for name, requires in _requirements().items()
        if requires
    }


def build_native(out: Path, plan: Plan | None = None, names: Sequence[str] = ()) -> list[Built]:
    """Build native FMUs into the folder `out`, with their cross-check files; by default all.

    Nothing is made where the stamp in the folder says that all is as it was built from these
    sources with this plan. ValueError, one line, for a name that is none or stays Python only, or
    where a compiler is missing; CompilerError where one fails.
    """
    plan = plan or planned()
    chosen = chosen_names(names)
    sources = sha256(f"{sources_hash()} {plan.key}".encode()).hexdigest()
    if not names and is_current(out, sources):
        return [Built(out / f"{name}.fmu", "unchanged") for name in chosen]
    from ..cross_check import cross_check_files  # only now: they take longer to load
    from ..package import shipped_model, write_members
    from .members import native_members

    models = {name: shipped_model(SCRIPTS / f"{name}.py") for name in chosen}
    members = {name: native_members(model, plan.fmi) for name, model in models.items()}
    built = []
    files = []
    for name, complete in with_binaries(members, plan):
        built.append(write_members(out / f"{name}.fmu", complete))
        checks = cross_check_files(name, models[name].block)
        for file, data in checks.items():
            write_file(out / file, data)
        files += [f"{name}.fmu", *checks]
    if not names:
        write_stamp(out, sources, files)
    return built


def build_native_block(file: Path, out: Path, plan: Plan | None = None) -> Built:
    """Build the native FMU of the block in a file of your own into the folder `out`.

    ValueError, one line, where the file is no block, or cannot be translated; else as build_native.
    """
    from ..block_build import own_model

    with own_model(file) as model:
        return build_native_model(model, out, plan or planned())


def build_native_model(model: Model, out: Path, plan: Plan) -> Built:
    """Build the native FMU of a model into the folder `out`, without cross-check files."""
    from ..package import write_members
    from .members import native_members

    name = model.description.name
    ((_, complete),) = with_binaries({name: native_members(model, plan.fmi)}, plan)
    return write_members(out / f"{name}.fmu", complete)


def chosen_names(names: Sequence[str] = ()) -> list[str]:
    """Return these names of blocks that come with the package, by default all that can be native.

    ValueError, one line, for one that is none, or that stays Python only.
    """
    only = python_only()
    known = [name for name in _requirements() if name not in only]
    for name in names:
        if name not in known:
            valid = f"no such block; must be of {', '.join(known)}, or a file NAME.py"
            raise ValueError(only.get(name, f"{name}: {valid}"))
    return [*names] or known


def _requirements() -> dict[str, Sequence[str]]:
    return {script.stem: slave_class(script).requires for script in sorted(SCRIPTS.glob("*.py"))}


def with_binaries(
    fmus: Mapping[str, Members], plan: Plan, networked: bool = False
) -> Iterator[tuple[str, Members]]:
    """Yield the FMUs by name with their binaries; those of one place become one for all.

    `networked` ones are linked with what sockets need.
    """
    jobs = [
        job(name, _sources(files), target, plan.compilers[target], networked)
        for name, files in fmus.items()
        for target in plan.places
    ]
    with TemporaryDirectory(prefix="grasp_fmus_") as scratch:
        made = iter([library.read_bytes() for library in compile_all(jobs, Path(scratch))])
    for name, files in fmus.items():
        thin: dict[str, list[bytes]] = {}
        for target, folder in plan.places.items():
            thin.setdefault(f"binaries/{folder}/{name}{target.suffix}", []).append(next(made))
        binaries = {
            place: several[0] if len(several) == 1 else universal(several)
            for place, several in thin.items()
        }
        yield name, {**files, **binaries}


def job(
    name: str,
    sources: Mapping[str, bytes],
    target: Target,
    compiler: Compiler,
    networked: bool = False,
) -> Job:
    """Return what makes the library of an FMU, in which functions are called as in the standard."""
    libraries = NETWORKED.get(target.suffix, ()) if networked else ()
    return Job(name, sources, compiler, target.suffix, UNPREFIXED, libraries)


def _sources(files: Members) -> dict[str, bytes]:
    """Return the files of sources/ by their names there."""
    return {
        name.removeprefix("sources/"): data
        for name, data in files.items()
        if name.startswith("sources/")
    }
