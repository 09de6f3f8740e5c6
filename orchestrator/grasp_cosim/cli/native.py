"""Which FMUs a command runs: those that need Python, or their native twins, with the same bits."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import click

from ..errors import InputError, choices
from ..files import NATIVE_FOLDER
from ..system.description import System
from ..system.parts import Component
from .frame import Command, say, waiting

LOGGER = logging.getLogger(__name__)

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
def natively(system: System, native: bool | None) -> Iterator[System]:
    """The system with the native twins of its FMUs; as it is, where `native` is False.

    None takes the twins that there are or can be built; which that were is said in one line at the
    end of the context. With True, InputError where those of our own blocks cannot be built. An FMU
    without a twin stays as it is, and one that needs no Python has none.
    """
    with all_natively([system], native) as (chosen,):
        yield chosen


@contextmanager
def all_natively(systems: Sequence[System], native: bool | None) -> Iterator[tuple[System, ...]]:
    """The same of several systems; what is the same of them is said once."""
    found = [({}, "") if native is False else _twins(s, native is True) for s in systems]
    yield tuple(s.with_natives(twins) for s, (twins, _) in zip(systems, found, strict=True))
    for line in dict.fromkeys(line for _, line in found if line):
        say(line)


def _twins(system: System, asked: bool) -> tuple[dict[str, Path], str]:
    """The twins by component, and what is to be said of them; nothing where all is as asked."""
    from grasp_fmus.native.twins import NoTwinsError, shipped_twins

    folder, failure = None, ""
    shipped = {c.name for c in system.components if _is_shipped(c)}
    if shipped:
        try:
            folder = shipped_twins(waiting)
        except NoTwinsError as error:
            failure = str(error)
    if folder:
        LOGGER.info("native FMUs: %s", folder)
    twins = {c.name: twin for c in system.components if (twin := _twin(c, folder))}
    if asked and failure and not twins.keys() >= shipped:
        raise InputError(f"--native: {failure}")
    left = [c for c in system.components if c.name not in twins and c.interface.python]
    but = choices((f"{c.name} ({_why(c)})" for c in left), FEW)
    if twins and left:
        return twins, f"ran native FMUs, but not as {but}; {WAY_BACK}"
    if twins:
        return twins, "" if asked else f"ran native FMUs; {WAY_BACK}"
    if failure:
        return twins, f"ran FMUs in Python, which takes longer: {failure}"
    said = left if asked else any(map(_is_ours, left))
    return twins, f"ran no native FMU: {but}" if said else ""


def _is_ours(component: Component) -> bool:
    """True for an FMU that runs a block of ours in Python."""
    made = component.interface
    return made.python and (made.tool or "").startswith("grasp-cosim ")


def _is_shipped(component: Component) -> bool:
    from grasp_fmus.native.twins import is_shipped

    return _is_ours(component) and is_shipped(component.interface.identifier)


def _twin(component: Component, shipped: Path | None) -> Path | None:
    """The native FMU of the same content as the component's, of those built and of the user's."""
    from grasp_fmus.native.twins import is_twin

    if not _is_ours(component):
        return None
    places = [*([shipped / _file(component)] if shipped else []), *_users(component)]
    return next((p for p in places if is_twin(p, component.interface.guid)), None)


def _users(component: Component) -> list[Path]:
    """Where a twin may be that the user has built."""
    folders = NATIVE_FOLDER, component.fmu.parent.parent / NATIVE_FOLDER.name
    return [folder / _file(component) for folder in folders]


def _file(component: Component) -> str:
    """The name of the FMU as it was built, whatever it is called now."""
    return f"{component.interface.identifier}.fmu"


def _why(component: Component) -> str:
    there = [p for p in _users(component) if p.is_file()] if _is_ours(component) else []
    name = component.fmu.name
    if there:
        return f"{there[0]} is not the twin of this {name}, or not for this machine"
    return f"{name} has no native twin"
