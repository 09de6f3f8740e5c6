"""The commands that repeat the paper: evaluate its tables, identify its friction."""

from collections.abc import Sequence
from pathlib import Path

import click

from ..base.files import check_folder, write_text
from ..grasp.identification.identification import DEFAULT_GROUPS, GROUPS, SENSOR
from ..grasp.identification.identification import identify as run_identification
from ..grasp.published.evaluation import evaluate as run_evaluation
from ..grasp.published.evaluation import verdict
from ..grasp.system import grasp_system
from ..recording.log_names import LogNames
from ..report.plot import save_figure
from ..system.overrides import Override
from .frame import NEGATIVE, PATH, is_quiet, json_option, show
from .options import controller_option, map_option, native_option, set_option


@click.command()
@click.option(
    "--bench", is_flag=True, help="Repeat the experiments, with friction and sensor electronics."
)
@controller_option
@click.option(
    "-o",
    "--out",
    type=PATH,
    default=Path("results"),
    help="Folder for the page evaluation.html and the numbers.",
)
@native_option
@json_option
def evaluate(
    bench: bool, controller: str | None, out: Path, native: bool | None, as_json: bool
) -> int:
    """Repeat the results of the paper, and check its claims.

    The command repeats the tables and figures of the simulations, or of the experiments with
    --bench. The exit code is 1 if a claim of the paper does not hold.

    \b
    Example: grasp-cosim evaluate --out results
    """
    report = run_evaluation(
        bench=bench,
        controller=controller or "published",
        out=out,
        native=native,
        progress=not is_quiet(),
    )
    page = f"to be opened in a browser: {out / 'evaluation.html'}"
    show(as_json, report, f"{verdict(report)}\n{page}")
    return 0 if all(claim["holds"] for claim in report["claims"]) else NEGATIVE


@click.command()
@click.argument("log", type=PATH, required=False)
@click.option(
    "--fit",
    multiple=True,
    default=DEFAULT_GROUPS,
    metavar="|".join([*GROUPS, SENSOR]),
    help="Group of values to fit, or that of one finger, such as inner[2]. Repeat the option to "
    "fit several groups.",
)
@click.option(
    "--cross-validate",
    is_flag=True,
    help="Repeat the fit to contact times without each row, and print by how much it misses it.",
)
@map_option
@set_option
@click.option("-o", "--out", type=PATH, help="Folder for the fitted values and the residuals.")
@json_option
def identify(
    log: Path | None,
    fit: tuple[str, ...],
    cross_validate: bool,
    names: LogNames,
    overrides: Sequence[Override],
    out: Path | None,
    as_json: bool,
) -> int:
    """Fit friction, masses and drives of the fingers, or a sensor, to measurements.

    LOG contains the signals of a run or of a test bench (.csv, .arrow, .parquet or .mf4). LOG may
    also be a table of contact times with the columns x_m, case, finger and time. The default is
    the contact times of the published experiments. With --fit sensor, LOG is the curve of a
    sensor with the columns gap and voltage. `run --values` uses the fitted values.

    \b
    Example: grasp-cosim identify --fit coulomb --fit viscous --out fitted
    Fit to a run: grasp-cosim identify results/signals.csv --fit coulomb
    Fit to a log of a bench: grasp-cosim identify bench.csv --map names.toml
    Calibrate a sensor: grasp-cosim identify curve.csv --fit sensor --out sensor
    Use the values: grasp-cosim run --preset bench --values fitted/values.toml
    """
    if out:
        check_folder(out)
    system = grasp_system().with_overrides(overrides)
    identification = run_identification(
        log,
        fit=fit,
        system=system,
        progress=not is_quiet(),
        names=names,
        cross_validation=cross_validate,
    )
    if out:
        for name, figure in identification.pictures().items():
            save_figure(figure, out / name)
        for name, text in identification.files().items():
            write_text(out / name, text)
    show(as_json, identification.as_json(), identification.text())
    return 0
