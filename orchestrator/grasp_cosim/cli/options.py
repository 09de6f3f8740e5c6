"""Groups of options that commands share, each with what it comes to."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import click

from ..system.description import System
from ..system.structure import DIVERGING, SCHEMES
from .frame import load_system, pair, together, with_controller, with_preset

set_option = click.option("--set", "settings", multiple=True, metavar="COMPONENT.VARIABLE=VALUE")

controller_option = click.option(
    "--controller",
    type=click.Choice(("published", "adaptive")),
    help="The published controller or the adaptive one, in the place of the system's.",
)

system_options = together(
    controller_option,
    click.option("--preset", "presets", multiple=True, help="Values that the system file names."),
    click.option("--case", type=click.IntRange(0, 2), help="Short for --preset case_0, ..._2."),
    click.option("--bench", is_flag=True, help="Short for --preset bench."),
    set_option,
    click.option("--step", type=float, help="Communication step in s."),
    click.option("--stop", type=float, help="Stop time in s."),
    click.option("--scheme", type=click.Choice(SCHEMES)),
    click.option(
        "--diverging",
        type=click.Choice(DIVERGING),
        help="Where a signal runs away: stop (default) or continue.",
    ),
)
"""How the system of a command, in its `system`, is changed."""


def set_values(settings: Sequence[str]) -> dict[str, Any]:
    """The values of --set by the names of their variables."""
    return dict(pair("--set", text, "COMPONENT.VARIABLE=VALUE") for text in settings)


def chosen_system(given: Mapping[str, Any], swapped: Collection[str] = ()) -> System:
    """The system with a controller, presets, the case last, another experiment; without --set.

    `given` are the values of all options of a command by name, `swapped` the components that get
    another FMU, of which the controller must be none.
    """
    step, stop, case = given["step"], given["stop"], given["case"]
    loaded = load_system(given["system"], step, stop)
    system = with_controller(loaded, given["controller"], swapped)
    names = [*given["presets"], *(["bench"] if given["bench"] else [])]
    for name in [*names, *([] if case is None else [f"case_{case}"])]:
        system = with_preset(system, name)
    return system.with_experiment(step, stop, given["scheme"], given["diverging"])
