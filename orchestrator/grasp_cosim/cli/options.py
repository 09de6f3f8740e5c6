"""Groups of options that commands share, each with what it comes to."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ..errors import InputError, choices
from ..system.description import System
from ..system.parts import ISOLATIONS
from ..system.stimuli import INTERPOLATIONS, Stimuli, read_stimuli
from ..system.structure import DIVERGING, SCHEMES
from ..system.swap import Replacement
from .frame import PATH, load_system, pair, together, with_controller, with_preset

set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="COMPONENT.VARIABLE=VALUE",
    help="Start value of a variable, like plant.object_width=0.06.",
)

swap_option = click.option(
    "--swap",
    "swaps",
    multiple=True,
    metavar="COMPONENT=FMU",
    help="Another FMU in the place of a component.",
)

controller_option = click.option(
    "--controller",
    type=click.Choice(("published", "adaptive")),
    help="The published controller or the adaptive one, in the place of the system's.",
)

system_options = together(
    controller_option,
    click.option(
        "--preset",
        "presets",
        multiple=True,
        help="Values that the system file names.",
    ),
    click.option("--case", type=click.IntRange(0, 2), help="Short for --preset case_0, ..._2."),
    click.option("--bench", is_flag=True, help="Short for --preset bench."),
    set_option,
    click.option("--step", type=float, help="Communication step in s."),
    click.option("--stop", type=float, help="Stop time in s."),
    click.option(
        "--scheme",
        type=click.Choice(SCHEMES),
        help="Components step one after the other (by default), or all at once.",
    ),
    click.option(
        "--diverging",
        type=click.Choice(DIVERGING),
        help="Where a signal runs away: stop (default) or continue.",
    ),
)
"""How the system of a command, in its `system`, is changed."""

names_options = together(
    click.option(
        "--rename",
        "renames",
        multiple=True,
        metavar="[COMPONENT.]VARIABLE=FMUS_VARIABLE",
        help="What the new FMU calls a variable of the system.",
    ),
    click.option(
        "--units",
        "named",
        multiple=True,
        metavar="[COMPONENT.]VARIABLE=UNIT",
        help="Of the new FMU, where it declares none or a wrong one.",
    ),
)
"""Names and units of an FMU in the place of another, in its `renames` and `named`."""

_FORMS = {
    "--rename": "[COMPONENT.]VARIABLE=FMUS_VARIABLE",
    "--units": "[COMPONENT.]VARIABLE=UNIT",
    "--isolation": "none, process, or COMPONENT=none, COMPONENT=process",
}


def replacements(given: Mapping[str, Any], fmus: Mapping[str, Path]) -> dict[str, Replacement]:
    """The FMUs for components by name, with what names_options say of each.

    InputError where that is of another component, or of one of several that is not named.
    """
    rename, units = (
        _by_component(option, given[key], tuple(fmus))
        for option, key in (("--rename", "renames"), ("--units", "named"))
    )
    return {name: Replacement(fmu, rename[name], units[name]) for name, fmu in fmus.items()}


def _by_component(
    option: str, texts: Sequence[str], components: Sequence[str]
) -> dict[str, dict[str, str]]:
    """The pairs of an option by component, which a text may leave out where there is one only."""
    found: dict[str, dict[str, str]] = {name: {} for name in components}
    for text in texts:
        left, right = pair(option, text, _FORMS[option])
        name, _, variable = left.partition(".")
        if not components:
            raise InputError(f"{option} {text!r}: must come with --swap COMPONENT=FMU")
        if name not in found or not variable:
            name, variable = components[0], left
            if len(components) > 1:
                raise InputError(
                    f"{option} {text!r}: several components are swapped; must begin with one of "
                    f"{choices(f'{c}.' for c in components)}"
                )
        found[name][variable] = right
    return found


def isolations(system: System, texts: Sequence[str]) -> System:
    """The system with its components in processes of their own or not, as texts say, in order.

    Each is of all components, "process", or of one, "plant=process".
    """
    for text in texts:
        name, equals, last = text.rpartition("=")
        where: Any = last
        if where not in ISOLATIONS or bool(name) != bool(equals):
            raise InputError(f"--isolation {text!r}: must be {_FORMS['--isolation']}")
        if name:
            system.component(name, f"--isolation {text}")
        system = system.with_isolation(where, name)
    return system


input_options = together(
    click.option(
        "--input", type=PATH, help="A CSV file: time, then inputs like plant.force, driven by it."
    ),
    click.option(
        "--interpolation",
        type=click.Choice(INTERPOLATIONS),
        help="Of --input, between two rows: linear (default; of continuous Reals) or held.",
    ),
)


def chosen_stimuli(given: Mapping[str, Any]) -> Stimuli | None:
    """The stimuli of --input, for FMUs that may yet be swapped."""
    if not given["input"]:
        if given["interpolation"]:
            raise InputError("--interpolation: must come with --input, the file that it is for")
        return None
    stimuli = read_stimuli(given["input"], given["interpolation"] or "linear")
    return replace(stimuli, partial=True)


def set_values(settings: Sequence[str]) -> dict[str, Any]:
    """The values of --set by the names of their variables."""
    return dict(pair("--set", text, "COMPONENT.VARIABLE=VALUE") for text in settings)


def swapped_fmus(swaps: Sequence[str]) -> dict[str, Path]:
    """The FMUs of --swap by the components whose place they take."""
    return {name: Path(fmu) for name, fmu in (pair("--swap", t, "COMPONENT=FMU") for t in swaps)}


def chosen_system(
    given: Mapping[str, Any], swapped: Collection[str] = (), stimuli: Stimuli | None = None
) -> System:
    """The system with a controller, presets, the case last, another experiment; without --set.

    `given` are the values of all options of a command by name, `swapped` the components that get
    another FMU, of which the controller must be none.
    """
    step, stop, case = given["step"], given["stop"], given["case"]
    loaded = load_system(given["system"], step, stop, stimuli)
    system = with_controller(loaded, given["controller"], swapped)
    names = [*given["presets"], *(["bench"] if given["bench"] else [])]
    for name in [*names, *([] if case is None else [f"case_{case}"])]:
        system = with_preset(system, name)
    return system.with_experiment(step, stop, given["scheme"], given["diverging"])
