"""The command identify."""

from pathlib import Path

import click

from ...base.files import check_folder, write_text
from ...grasp.identification.identification import DEFAULT, GROUPS
from ...grasp.identification.identification import identify as run_identification
from ...grasp.system import grasp_system
from ..frame import PATH, is_quiet, json_option, show
from ..options import set_option, set_values


@click.command()
@click.argument("log", type=PATH, required=False)
@click.option(
    "--fit",
    multiple=True,
    default=DEFAULT,
    show_default=True,
    metavar="|".join(GROUPS),
    help="Fit this; may be given several times.",
)
@set_option
@click.option("-o", "--out", type=PATH, help="Folder for the values and the residuals.")
@json_option
def identify(
    log: Path | None,
    fit: tuple[str, ...],
    settings: tuple[str, ...],
    out: Path | None,
    as_json: bool,
) -> int:
    """Fit the friction of the fingers to a LOG.

    It is a run, as .csv or .mf4, or a table of contact times: CSV with the columns x_m, case,
    finger, time. By default these are the contact times of the published experiments.

    \b
    Example: grasp-cosim identify --fit coulomb --fit viscous --out identified
    From a run: grasp-cosim identify results/signals.csv --fit coulomb
    """
    if out:
        check_folder(out)
    system = grasp_system().with_settings(set_values(settings), "--set {}".format)
    found = run_identification(log, fit=fit, system=system, progress=not is_quiet())
    for name, text in found.files().items() if out else ():
        write_text(Path(out or "", name), text)
    show(as_json, found.as_json(), found.text())
    return 0
