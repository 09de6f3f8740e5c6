"""What the shell completes besides commands, options and files: names of the system and studies.

A system that cannot be read has no names here: the command itself will say what is wrong with it.
"""

from collections.abc import Callable
from pathlib import Path

import click
from click.shell_completion import CompletionItem

from ..errors import InputError
from ..extensions import readers
from ..system.description import System
from .frame import load_system

Complete = Callable[[click.Context, click.Parameter, str], list[str]]


def components(after: str = "") -> Complete:
    """Completes the name of a component, and what follows it, as "=" in COMPONENT=FMU."""

    def complete(ctx: click.Context, _: click.Parameter, begun: str) -> list[str]:
        names = [c.name for system in _system(ctx) for c in system.components]
        return _beginning(begun, [name + after for name in names])

    return complete


def variables(ctx: click.Context, _: click.Parameter, begun: str) -> list[str]:
    """Completes COMPONENT.VARIABLE= of what can be set."""
    return _beginning(
        begun,
        [
            f"{c.name}.{v.name}="
            for system in _system(ctx)
            for c in system.components
            for v in c.interface.variables
            if v.settable
        ],
    )


def preset_names(ctx: click.Context, _: click.Parameter, begun: str) -> list[str]:
    """Completes the name of a preset of the system or of the built-in grasp."""
    from ..grasp.presets import built_in_presets

    own = [name for system in _system(ctx) for name in system.presets]
    return _beginning(begun, [*own, *built_in_presets()])


def studies(_: click.Context, __: click.Parameter, begun: str) -> list[CompletionItem]:
    """Completes the name of a built-in study, or a file."""
    from ..grasp.presets import STUDIES

    names = _beginning(begun, sorted(path.stem for path in STUDIES.glob("*.toml")))
    return [*map(CompletionItem, names), CompletionItem(begun, type="file")]


def _system(ctx: click.Context) -> list[System]:
    """The system of a command; none where it cannot be read.

    Where the option at hand has no value yet, click leaves all arguments as they are.
    """
    files = (Path(word) for word in ctx.args if Path(word).suffix.lower() in readers)
    try:
        return [load_system(ctx.params.get("system") or next(files, None))]
    except (InputError, OSError):
        return []


def _beginning(begun: str, names: list[str]) -> list[str]:
    return [name for name in dict.fromkeys(names) if name.startswith(begun)]
