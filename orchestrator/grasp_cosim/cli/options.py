"""Options that say which system a command runs, and what they come to."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any

import click

from ..base.errors import InputError
from ..base.progress import phase
from ..recording.log_names import AS_THEY_ARE, read_log_names
from ..system.connectors import reached
from ..system.description import System, read_system
from ..system.overrides import Override
from ..system.stimuli import Stimuli, read_stimuli
from .frame import PATH, pair, say, waiting

Command = Callable[..., Any]


native_option = click.option(
    "--native/--python",
    default=None,
    help="Run native twins in the place of Python FMUs, or the Python FMUs. Both give the same "
    "bits. Default: native, where a twin is known and there is a C compiler.",
)


def natively(system: System, native: bool | None) -> System:
    """The system with native FMUs as native_option says; that they are compiled is shown."""
    with waiting("compiling the native FMUs, once for these sources"):
        return system.natively(native)


def set_overrides(texts: Iterable[str]) -> list[Override]:
    """The overrides that texts of --set are, KEY=VALUE; InputError where two have one place."""
    pairs = (pair("--set", text, "KEY=VALUE") for text in texts)
    return each_once(Override(place, value, "--set {place}") for place, value in pairs)


def each_once(overrides: Iterable[Override]) -> list[Override]:
    """The overrides; InputError where two have one place."""
    by_place: dict[str, Override] = {}
    for override in overrides:
        if first := by_place.get(override.place):
            raise InputError(
                f"{override.label}: {override.place} is given by {first.label}, too; must be given "
                "once"
            )
        by_place[override.place] = override
    return [*by_place.values()]


set_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    callback=lambda _, __, texts: set_overrides(texts),
    metavar="KEY=VALUE",
    help="Set a key of the system file, such as experiment.scheme=jacobi. The short form "
    "plant.object_width=0.06 sets a start value in the unit of the variable. A value may have a "
    "unit: 'plant.object_width=60 mm'.",
)

values_option = click.option(
    "--values",
    "fitted",
    type=PATH,
    help="TOML file with the tables [values] and [drives]. `identify -o` writes one.",
)

map_option = click.option(
    "--map",
    "names",
    type=PATH,
    callback=lambda _, __, path: read_log_names(path) if path else AS_THEY_ARE,
    help="TOML file that maps the columns of a log to signals, with their units and the offset of "
    "the time.",
)

SWAP_OPTIONS = (
    click.option(
        "--swap",
        "swaps",
        multiple=True,
        metavar="COMPONENT=FMU",
        help="Replace a component by another FMU.",
    ),
    click.option(
        "--own-values",
        is_flag=True,
        help="With --swap: use the start values of the new FMU, not the values in the system.",
    ),
)


def swap_options(command: Command) -> Command:
    """Other FMUs in the system of a command."""
    return reduce(lambda decorated, option: option(decorated), reversed(SWAP_OPTIONS), command)


controller_option = click.option(
    "--controller",
    type=click.Choice(("published", "adaptive")),
    help="Replace the controller of the system by the published or the adaptive controller.",
)

preset_option = click.option(
    "--preset", "presets", multiple=True, metavar="NAME", help="Apply a preset of the system file."
)

record_option = click.option(
    "--record",
    multiple=True,
    metavar="NAME,NAME,...",
    help="Record these outputs, inputs, parameters or local variables, such as "
    "plant.*,controller.force[1]. '!plant.clock' leaves a signal out. Default: the signals that "
    "SYSTEM names, or all outputs.",
)

step_option = click.option(
    "--step", metavar="SECONDS", help="Communication step in s, such as 1e-3 or 1/30."
)

stop_option = click.option("--stop", metavar="SECONDS", help="Stop time in s.")

SYSTEM_OPTIONS = (
    controller_option,
    preset_option,
    click.option(
        "--case", type=click.IntRange(0, 2), help="Apply the preset case_0, case_1 or case_2."
    ),
    set_option,
    step_option,
    stop_option,
)


def system_options(command: Command) -> Command:
    """How the system of a command, in its `system`, is changed."""
    return reduce(lambda decorated, option: option(decorated), reversed(SYSTEM_OPTIONS), command)


PLACES = {
    "step": "experiment.step",
    "stop": "experiment.stop",
    "scheme": "experiment.scheme",
    "input": "input.file",
}
"""The places of a system file that have a separate option."""

TIMES = ("experiment.start", "experiment.step", "experiment.stop")
"""The places that an archive of another tool may leave open until it is read."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SystemOptions:
    """The options of a command on its system, by the names that click gives them.

    overrides are those of --set, swaps the texts of --swap, record those of --record. fitted is the
    file of --values. input is the table that drives inputs. Times are texts, in s.
    """

    system: Path | None = None
    controller: str | None = None
    presets: Sequence[str] = ()
    case: int | None = None
    overrides: Sequence[Override] = ()
    step: str | None = None
    stop: str | None = None
    scheme: str | None = None
    swaps: Sequence[str] = ()
    own_values: bool = False
    input: Path | None = None
    record: Sequence[str] = ()
    fitted: Path | None = None

    @property
    def all_presets(self) -> Sequence[str]:
        """The presets, that of the case last."""
        return self.presets if self.case is None else (*self.presets, f"case_{self.case}")


def overrides_of(options: SystemOptions) -> list[Override]:
    """The overrides that options are: those of places with a separate option, swaps, --set.

    InputError where two have one place.
    """
    overrides = []
    for option, place in PLACES.items():
        value = getattr(options, option)
        if value is not None:
            overrides.append(Override(place, value, f"--{option}"))
    for text in options.swaps:
        name, fmu = pair("--swap", text, "COMPONENT=FMU")
        overrides.append(Override(f"components.{name}.fmu", fmu, f"--swap {name}"))
    return each_once([*overrides, *options.overrides])


def load_system(
    path: Path | None,
    times: Iterable[Override] = (),
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


def chosen_system(options: SystemOptions) -> System:
    """The system of a command, as its options have it; notes name the parts that are left out.

    These are its controller, then presets, that of the case last, then what was fitted, then
    overrides of single values, and what is recorded.
    """
    overrides = {override.place: override for override in overrides_of(options)}
    times = [overrides[place] for place in TIMES if place in overrides]
    stimuli = _stimuli(overrides)
    variant = overrides.pop("experiment.variant", None)
    loaded = load_system(options.system, times, stimuli, variant.value if variant else None)
    _check_not_driven(loaded, overrides)
    swapped = [c.name for c in loaded.components if f"components.{c.name}.fmu" in overrides]
    system = loaded
    if options.own_values:
        if not swapped:
            raise InputError("--own-values: does nothing without --swap")
        system = system.with_own_values(*swapped)
    if options.controller:
        from ..grasp.system import with_controller

        system = with_controller(system, options.controller, swapped)
    for preset in options.all_presets:
        system = _with_preset(system, preset)
    if options.fitted:
        from ..grasp.identification.fitted_values import with_fitted

        system = with_fitted(system, options.fitted)
    system = system.with_overrides(overrides.values())
    for note in system.notes[len(loaded.notes) :]:
        say(note)
    if options.record:
        record = system.record.with_texts(options.record)
        record.check("--record", system.components, system.outputs)
        system = replace(system, record=record)
    return system.with_input(replace(stimuli, partial=False)) if stimuli else system


def _stimuli(overrides: dict[str, Override]) -> Stimuli | None:
    """The stimuli of the overrides of [input], which are taken out; None where no file is named.

    They may drive variables of FMUs that are swapped in afterwards.
    """
    file = overrides.pop("input.file", None)
    if file is None:
        return None
    interpolation = overrides.pop("input.interpolation", None)
    between_rows = interpolation.value if interpolation else "linear"
    stimuli = read_stimuli(file.value, between_rows, "--set input.interpolation")
    return replace(stimuli, partial=True)


def _check_not_driven(system: System, places: Iterable[str]) -> None:
    """InputError at a place whose value does nothing, as a column of stimuli goes before it."""
    if system.input is None:
        return
    columns = {str(port) for port in system.input.columns}
    for place in places:
        if columns.issuperset(reached(system, place)):
            raise InputError(f"--set {place}: does nothing, as {system.input.file} drives it")


def _with_preset(system: System, name: str) -> System:
    """The system with its own preset, or else with one of the built-in grasp."""
    if name in system.presets:
        return system.with_presets(name)
    from ..grasp.presets import with_preset

    return with_preset(system, name)
