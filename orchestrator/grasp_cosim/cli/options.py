"""Options that say which system a command runs, and what they come to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from ..base.errors import InputError
from ..base.progress import phase
from ..recording.log_names import AS_THEY_ARE, read_log_names
from ..system.connectors import reached
from ..system.description import System, read_system
from ..system.record import Record
from ..system.stimuli import Stimuli, read_stimuli
from .frame import PATH, pair, say, waiting

Command = Callable[..., Any]


def native_option(default: str) -> Command:
    """The option of commands that run systems; `default` says what they do without it."""
    return click.option(
        "--native/--python",
        default=None,
        help=f"Run native twins of Python FMUs, or these, bit for bit. Default: {default}",
    )


many_runs_option = native_option("native, where there is a C compiler.")
"""The option of commands that do many runs."""


def natively(system: System, native: bool | None) -> System:
    """The system with native FMUs as native_option says; that they are compiled is shown."""
    with waiting("compiling the native FMUs, once for these sources"):
        return system.natively(native)


set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PLACE=VALUE",
    help="Change a value of the system file, by its place there: plant.object_width=0.06, in the "
    "unit of the variable, or 'plant.object_width=60 mm'; experiment.scheme=jacobi, "
    "components.plant.isolation=process.",
)

values_option = click.option(
    "--values",
    "fitted",
    type=PATH,
    help="TOML file with [values] by name, and [drives], as identify -o writes it.",
)

map_option = click.option(
    "--map",
    "names",
    type=PATH,
    callback=lambda _, __, path: read_log_names(path) if path else AS_THEY_ARE,
    help="TOML file: which column of a log from elsewhere is which signal, in which unit, and the "
    "offset of its time.",
)

SWAP_OPTIONS = (
    click.option(
        "--swap",
        "swaps",
        multiple=True,
        metavar="COMPONENT=FMU",
        help="Put another FMU in the place of a component.",
    ),
    click.option(
        "--own-values",
        is_flag=True,
        help="With --swap: take the start values of the new FMU, not those that the system sets.",
    ),
)


def swap_options(command: Command) -> Command:
    """Other FMUs in the system of a command."""
    return reduce(lambda made, option: option(made), reversed(SWAP_OPTIONS), command)


controller_option = click.option(
    "--controller",
    type=click.Choice(("published", "adaptive")),
    help="Take the published controller or the adaptive one in the place of the system's.",
)

preset_option = click.option(
    "--preset", "presets", multiple=True, metavar="NAME", help="Take a preset of the system file."
)

record_option = click.option(
    "--record",
    multiple=True,
    metavar="NAME,NAME,...",
    help="Record these signals, be they outputs, inputs, parameters or locals: "
    "plant.*,controller.force[1]; '!plant.clock' leaves one out. Default: what SYSTEM says, or "
    "else the outputs.",
)

step_option = click.option(
    "--step", metavar="S", help="Communication step in s, like 1e-3 or 1/30."
)

stop_option = click.option("--stop", metavar="S", help="Stop time in s.")

SYSTEM_OPTIONS = (
    controller_option,
    preset_option,
    click.option("--case", type=click.IntRange(0, 2), help="Short for --preset case_0, ..._2."),
    set_option,
    step_option,
    stop_option,
)


def system_options(command: Command) -> Command:
    """How the system of a command, in its `system`, is changed."""
    return reduce(lambda made, option: option(made), reversed(SYSTEM_OPTIONS), command)


PLACES = {
    "step": "experiment.step",
    "stop": "experiment.stop",
    "scheme": "experiment.scheme",
    "input": "input.file",
}
"""The places of a system file that have an option of their own."""


Option = Callable[[str], str]
"""The option that says a place, or the beginning of one, for messages."""


def settings_of(given: Mapping[str, Any]) -> tuple[dict[str, Any], Option]:
    """What options of a command, `given` by name, say of a system, by its places.

    InputError where two say the same place.
    """
    said: list[tuple[str, str, Any]] = [
        (f"--{o}", place, given.get(o)) for o, place in PLACES.items()
    ]
    for text in given.get("swaps", ()):
        name, fmu = pair("--swap", text, "COMPONENT=FMU")
        said.append((f"--swap {name}", f"components.{name}.fmu", fmu))
    for text in given.get("settings", ()):
        place, value = pair("--set", text, "PLACE=VALUE")
        said.append((f"--set {place}", place, value))
    values: dict[str, Any] = {}
    options: dict[str, str] = {}
    for option, place, value in said:
        if place in values:
            other = options[place]
            raise InputError(f"{option}: {place} is given by {other}, too; must be given once")
        if value is not None:
            values[place], options[place] = value, option
    return values, lambda place: options.get(place, f"--set {place}")


def set_values(settings: Sequence[str]) -> dict[str, Any]:
    """The values of --set by their places."""
    return settings_of({"settings": settings})[0]


def load_system(
    path: Path | None,
    times: Mapping[str, Any] = MappingProxyType({}),
    stimuli: Stimuli | None = None,
    variant: str | None = None,
) -> System:
    """The system of a file, by default the built-in grasp; what its reader notes is printed.

    stimuli go before those that it names; times and variant are as read_system() takes them.
    """
    with phase("reading the system"):
        if path is None:
            if variant is not None:
                raise InputError(
                    f"--set experiment.variant={variant}: the built-in system has no variants"
                )
            from ..grasp.system import as_named

            return as_named().with_input(stimuli)
        system = read_system(path, times, stimuli=stimuli, variant=variant)
    for note in system.notes:
        say(note)
    return system


def chosen_system(given: Mapping[str, Any]) -> System:
    """The system of a command with what its options, `given` by name, make of it.

    These are its controller, presets, the case last, then single values; what is left out is said.
    """
    settings, option = settings_of(given)
    times = {
        key: settings[place]
        for key in ("start", "step", "stop")
        if (place := f"experiment.{key}") in settings
    }
    stimuli = None
    if "input.file" in settings:
        way = settings.pop("input.interpolation", "linear")
        stimuli = read_stimuli(settings.pop("input.file"), way, "--set input.interpolation")
        stimuli = replace(stimuli, partial=True)  # FMUs may yet be swapped
    variant = settings.pop("experiment.variant", None)
    loaded = load_system(given.get("system"), times, stimuli, variant)
    if loaded.input:
        columns = {str(port) for port in loaded.input.columns}
        for place in settings:
            if columns.issuperset(reached(loaded, place)):
                raise InputError(f"--set {place}: does nothing, as {loaded.input.file} drives it")
    swapped = [c.name for c in loaded.components if f"components.{c.name}.fmu" in settings]
    own = swapped if given.get("own_values") else []
    if given.get("own_values") and not swapped:
        raise InputError("--own-values: does nothing without --swap")
    system = loaded.with_own_values(*own) if own else loaded
    if law := given.get("controller"):
        from ..grasp.system import with_controller

        system = with_controller(system, law, swapped)
    case = given.get("case")
    for name in [*given.get("presets", ()), *([] if case is None else [f"case_{case}"])]:
        if name in system.presets:
            system = system.with_presets(name)
        else:
            from ..grasp.presets import with_preset

            system = with_preset(system, name)
    if fitted := given.get("fitted"):
        from ..grasp.identification.values import with_fitted

        system = with_fitted(system, fitted)
    changed = system.with_settings(settings, option)
    for note in changed.notes[len(loaded.notes) :]:
        say(note)
    if given.get("record"):
        record = Record.listed(given["record"])
        record.check("--record", changed.components, changed.outputs)
        changed = replace(changed, record=record)
    return changed.with_input(replace(stimuli, partial=False)) if stimuli else changed
