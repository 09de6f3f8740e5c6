"""Groups of options that commands share, each with what it comes to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import click

from ..system.description import System
from ..system.structure import SCHEMES
from .frame import load_system, pair, together, with_preset

Group = TypeVar("Group")

system_options = together(
    click.option("--preset", "presets", multiple=True, help="Values that the system file names."),
    click.option("--case", type=click.IntRange(0, 2), help="Short for --preset case_0, ..._2."),
    click.option("--bench", is_flag=True, help="Short for --preset bench."),
    click.option("--set", "settings", multiple=True, metavar="COMPONENT.VARIABLE=VALUE"),
    click.option("--step", type=float, help="Communication step in s."),
    click.option("--stop", type=float, help="Stop time in s."),
    click.option("--scheme", type=click.Choice(SCHEMES)),
)
"""The options of SystemOptions, but for the system itself."""


def taken(group: type[Group], given: Mapping[str, Any]) -> Group:
    """The group of options, from the values that click gives by the names of its fields."""
    return group(**{f.name: given[f.name] for f in fields(group)})  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class SystemOptions:
    """A system file, None for the built-in grasp, and how its system is changed."""

    system: Path | None
    presets: tuple[str, ...]
    case: int | None
    bench: bool
    settings: tuple[str, ...]
    step: float | None
    stop: float | None
    scheme: str | None

    @property
    def values(self) -> dict[str, Any]:
        """The values of --set by the names of their variables."""
        return dict(pair("--set", text, "COMPONENT.VARIABLE=VALUE") for text in self.settings)

    def load(self) -> System:
        """The system with presets, the case last, and another experiment; without --set."""
        system = load_system(self.system, self.step, self.stop)
        names = [*self.presets, *(["bench"] if self.bench else [])]
        names += [] if self.case is None else [f"case_{self.case}"]
        for name in names:
            system = with_preset(system, name)
        return system.with_experiment(self.step, self.stop, self.scheme)
