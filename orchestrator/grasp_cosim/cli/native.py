"""Which FMUs a command runs: those that need Python, or their native twins, with the same bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click

from ..errors import InputError, choices
from ..system.description import System
from ..system.native import lacking, twins, users_twins
from ..system.parts import Component
from .frame import Command, say, waiting

FEW = 3
"""Components without a twin that are named at most."""

WAY_BACK = "--python runs those in Python, with the same bits"


def native_option(default: str) -> Command:
    """The option of commands that run systems; `default` says what they do without it."""
    return click.option(
        "--native/--python",
        default=None,
        help=f"Run FMUs, or their native twins: the same bits. Default: {default}",
    )


many_runs_option = native_option("native, where there is a C compiler.")
"""The option of commands that do many runs."""


@contextmanager
def natively(system: System, native: bool | None, as_named: bool = False) -> Iterator[System]:
    """The system with the native twins of its FMUs; as it is, where `native` is False.

    None takes the twins that there are or can be built; which that were is said in one line at the
    end of the context. With as_named it does so only where an FMU has no binary for this machine.
    With True, InputError where those of our own blocks cannot be built. An FMU without a twin stays
    as it is, and one that needs no Python has none.
    """
    if native is None and as_named:
        native = None if any(c.needs_native for c in system.components) else False
    with all_natively([system], native) as (chosen,):
        yield chosen


@contextmanager
def all_natively(systems: Sequence[System], native: bool | None) -> Iterator[tuple[System, ...]]:
    """The same of several systems; what is the same of them is said once."""
    found = [_as_named(s) if native is False else _twins(s, native is True) for s in systems]
    yield tuple(s.with_natives(twins) for s, (twins, _) in zip(systems, found, strict=True))
    for line in dict.fromkeys(line for _, line in found if line):
        say(line)


def _as_named(system: System) -> tuple[dict[str, Path], str]:
    """Nothing; InputError where an FMU in Python has no binary for this machine."""
    for component in system.components:
        if component.needs_native:
            said = f"{component.name}: {lacking(component)}"
            raise InputError(f"--python: {said}; must be without --python")
    return {}, ""


def _twins(system: System, asked: bool) -> tuple[dict[str, Path], str]:
    """The twins by component, and what is to be said of them; nothing where all is as asked."""
    found, failure = twins(system, waiting)
    if asked and failure:
        raise InputError(f"--native: {failure}")
    left = [c for c in system.components if c.name not in found and c.interface.python]
    but = choices((f"{c.name} ({_why(c)})" for c in left), FEW)
    needed = [c for c in system.components if c.needs_native and c.name in found]
    if needed and not asked:
        return found, f"ran native FMUs: {lacking(needed[0])}"
    if found and left:
        return found, f"ran native FMUs, but not as {but}; {WAY_BACK}"
    if found:
        return found, "" if asked else f"ran native FMUs; {WAY_BACK}"
    if failure:
        return found, f"ran FMUs in Python, which takes longer: {failure}"
    said = left if asked else any(map(users_twins, left))
    return found, f"ran no native FMU: {but}" if said else ""


def _why(component: Component) -> str:
    there = [p for p in users_twins(component) if p.is_file()]
    name = component.fmu.name
    if there:
        return f"{there[0]} is not the twin of this {name}, or not for this machine"
    return f"{name} has no native twin"
