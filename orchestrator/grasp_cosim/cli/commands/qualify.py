"""The command qualify."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ...errors import InputError, choices
from ...extensions import readers
from ...files import of_any_format, remove, write_json, write_text
from ...interface.read import check_runs
from ...qualification import verdict
from ...qualification.bands import read_bands
from ...qualification.qualify import Qualification
from ...qualification.qualify import qualify as run_qualification
from ...qualification.swap import component_of
from ...report.qualification import draw_qualification
from ...system.parts import ISOLATIONS, Isolation
from ...system.swap import Replacement
from ..frame import (
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    format_option,
    is_quiet,
    json_option,
    load_system,
    metrics_option,
    pair,
    say,
    show,
    together,
    waiting,
)
from ..options import (
    chosen_system,
    many_runs_option,
    natively,
    set_values,
    system_options,
)

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

FORMS = {
    "--rename": "[COMPONENT.]VARIABLE=FMUS_VARIABLE",
    "--units": "[COMPONENT.]VARIABLE=UNIT",
}


@click.command()
@click.argument("candidate", type=PATH)
@click.option(
    "--as",
    "component",
    required=True,
    metavar="COMPONENT",
    help="Whose place it takes.",
)
@click.option("--system", type=PATH, help="Default: the built-in grasp.")
@system_options
@click.option("--bands", type=PATH, help="TOML; default: derived.")
@names_options
@click.option(
    "--isolation",
    type=click.Choice(ISOLATIONS),
    default="process",
    show_default=True,
    help="Where the candidate runs.",
)
@many_runs_option
@metrics_option
@click.option(
    "--out",
    type=PATH,
    help="Folder for qualification.json, qualification.png and bands_used.toml.",
)
@format_option
@json_option
def qualify(
    candidate: Path,
    component: str,
    bands: Path | None,
    isolation: Isolation,
    native: bool | None,
    metric_files: tuple[Path, ...],
    out: Path | None,
    suffix: str,
    as_json: bool,
    **given: Any,
) -> int:
    """Find out whether CANDIDATE may take the place of COMPONENT.

    It is an FMU, or a system file: then the FMU of the component of that name, as it is there.

    Compares the interfaces, then the closed loops with the original and with the candidate, signal
    by signal and metric by metric. Exit code 0: qualified; 1: not.

    \b
    Example: grasp-cosim qualify vendor_plant.fmu --as plant --out qualification
    """
    check_outputs(out, plot=bool(out))
    new = replacements(given, {component: candidate})[component]
    is_file = candidate.suffix.lower() in readers
    if not is_file:
        check_runs(candidate)
    system = natively(chosen_system({**given, "settings": ()}), native)
    found = run_qualification(
        system,
        component,
        component_of(load_system(candidate), component, system) if is_file else candidate,
        rename=new.rename,
        units=new.units,
        values=set_values(given["settings"]),
        bands=read_bands(bands) if bands else None,
        isolation=isolation,
        progress=not is_quiet(),
        metrics=chosen_metrics(metric_files),
    )
    if out:
        _write(found, out, suffix)
    show(as_json, verdict.as_json(found), verdict.as_text(found))
    return 0 if found.qualified else NEGATIVE


def _write(found: Qualification, out: Path, suffix: str) -> None:
    """What there is: without a run there is no band and no figure, not even an earlier one."""
    figure, bands = out / f"qualification.{suffix}", out / "bands_used.toml"
    remove(out, "qualification.json", bands.name, *of_any_format(figure.stem))
    write_json(out / "qualification.json", verdict.as_json(found))
    if found.signals:
        write_text(bands, verdict.as_bands(found))
        with waiting("drawing"):
            draw_qualification(found, figure)
        say(f"drew {figure}")


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
        left, right = pair(option, text, FORMS[option])
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
