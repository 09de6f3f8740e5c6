"""The command qualify."""

import json
from pathlib import Path
from typing import Any

import click

from ...files import check_folder, write_text
from ...qualification import verdict
from ...qualification.bands import read_bands
from ...qualification.qualify import Qualification
from ...qualification.qualify import qualify as run_qualification
from ...report.plot import new_figure
from ...report.qualification import draw_qualification
from ...system.parts import ISOLATIONS, Isolation
from ..frame import NEGATIVE, chosen_metrics, json_option, metrics_option, pair
from ..options import SystemOptions, system_options, taken


@click.command()
@click.argument("candidate", type=click.Path(path_type=Path))
@click.option("--as", "component", required=True, metavar="COMPONENT", help="Whose place it takes.")
@click.option("--system", type=click.Path(path_type=Path), help="Default: the built-in grasp.")
@system_options
@click.option("--bands", type=click.Path(path_type=Path), help="TOML; default: derived.")
@click.option("--rename", "renames", multiple=True, metavar="VARIABLE=CANDIDATES_VARIABLE")
@click.option(
    "--isolation",
    type=click.Choice(ISOLATIONS),
    default="process",
    show_default=True,
    help="Where the candidate runs.",
)
@metrics_option
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for qualification.json, qualification.png and bands_used.toml.",
)
@json_option
def qualify(
    candidate: Path,
    component: str,
    bands: Path | None,
    renames: tuple[str, ...],
    isolation: Isolation,
    metric_files: tuple[Path, ...],
    out: Path | None,
    as_json: bool,
    **given: Any,
) -> int:
    """Find out whether CANDIDATE, an FMU, may take the place of COMPONENT.

    Compares the interfaces, then the closed loops with the original and with the candidate, signal
    by signal and metric by metric. Exit code 0: qualified; 1: not.

    \b
    Example: grasp-cosim qualify vendor_plant.fmu --as plant --out qualification
    """
    if out:
        check_folder(out)
        new_figure(1.0, 1.0)  # tells that matplotlib is missing before the runs, not after
    options = taken(SystemOptions, given)
    found = run_qualification(
        options.load(),
        component,
        candidate,
        rename=dict(pair("--rename", text, "VARIABLE=CANDIDATES_VARIABLE") for text in renames),
        values=options.values,
        bands=read_bands(bands) if bands else None,
        isolation=isolation,
        progress=True,
        metrics=chosen_metrics(metric_files),
    )
    if out:
        _write(found, out)
    click.echo(json.dumps(verdict.as_json(found)) if as_json else verdict.as_text(found))
    return 0 if found.qualified else NEGATIVE


def _write(found: Qualification, out: Path) -> None:
    """What there is: without a run there is no band and no figure, not even an earlier one."""
    figure, bands = out / "qualification.png", out / "bands_used.toml"
    write_text(out / "qualification.json", json.dumps(verdict.as_json(found), indent=2) + "\n")
    if found.signals:
        write_text(bands, verdict.as_bands(found))
        draw_qualification(found, figure)
        click.echo(f"drew {figure}", err=True)
    else:
        figure.unlink(missing_ok=True)
        bands.unlink(missing_ok=True)
