"""The command evaluate."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ...files import check_folder
from ...grasp.presets import with_preset
from ...grasp.published.evaluate import PICTURES
from ...grasp.published.evaluate import evaluate as run_evaluation
from ...grasp.published.store import FOLDER
from ...grasp.published.tables import Source
from ...numerals import counted, fixed
from ...sweep.store import Parts
from ..frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    fail,
    format_option,
    is_quiet,
    json_option,
    load_system,
    show,
    with_controller,
    workers_option,
)
from ..options import controller_option, many_runs_option, natively


@click.command()
@click.option("--bench", is_flag=True, help="The experiments, with friction and electronics.")
@controller_option
@click.option(
    "--out",
    type=PATH,
    default=Path("results"),
    show_default=True,
    help="Folder for report.md, pictures and numbers.",
)
@workers_option
@many_runs_option
@format_option
@json_option
def evaluate(
    bench: bool,
    controller: str | None,
    out: Path,
    workers: int,
    native: bool | None,
    suffix: str,
    as_json: bool,
) -> int:
    """Run the published table and figures, and compare.

    With --bench these are the experiments, else the simulations. Finished grasps are kept until all
    are done: the same command goes on where it was ended.

    \b
    Example: grasp-cosim evaluate --out results
    """
    check_folder(out)
    system = with_controller(load_system(), controller)
    source: Source = "experiment" if bench else "simulation"
    system = with_preset(system, "bench") if bench else system
    try:
        chosen = natively(system, native)
        report = run_evaluation(chosen, out, workers, not is_quiet(), source, suffix)
    except KeyboardInterrupt:
        kept = Parts(out / FOLDER).kept()
        goes_on = f"; {counted(kept, 'grasp')} kept in {out / FOLDER}, the same command goes on"
        return fail(f"interrupted{goes_on if kept else ''}", INTERRUPTED)
    holds = all(claim["holds"] for claim in report["claims"])
    show(as_json, report, _verdict(report, out, suffix))
    return 0 if holds else NEGATIVE


def _verdict(report: Mapping[str, Any], out: Path, suffix: str) -> str:
    rms = ", ".join(
        f"{name.replace('_', ' ')} {fixed(value, 3, rounded=True)}"
        for name, value in report["rms"].items()
    )
    return "\n".join(
        [
            *(f"{'holds' if c['holds'] else 'FAILS'}  {c['text']}" for c in report["claims"]),
            f"root mean square of the differences in s: {rms}",
            f"report: {out / 'report.md'}   pictures: "
            + ", ".join(str(out / f"{name}.{suffix}") for name in PICTURES),
        ]
    )
