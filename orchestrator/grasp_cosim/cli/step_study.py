"""The step study of the command run."""

import json
import os
from pathlib import Path
from typing import NamedTuple

import click

from ..convergence.step_study import ask, step_study
from ..files import check_folder, write_text
from ..metrics.metric import Metric
from ..report.plot import new_figure
from ..report.step_study import draw_step_study
from ..system.description import System
from .frame import NEGATIVE


class StepStudyRequest(NamedTuple):
    """The system, the metrics or signals asked about, the tolerance in their unit, own metrics."""

    system: System
    of: tuple[str, ...]
    tolerance: float | None
    metrics: tuple[Metric, ...]


def run_step_study(request: StepStudyRequest, out: Path | None, plot: bool, as_json: bool) -> int:
    """Study the step of a system, print and write what was found, return the exit code.

    0 where the system's own step keeps what is asked about within the tolerance, else NEGATIVE.
    `out` is the folder for step_study.json; `plot` draws step_study.png there or in the current
    folder.
    """
    system, of, tolerance, metrics = request
    ask(system, of, tolerance, metrics)
    if out or plot:
        check_folder(out or Path())
    if plot:
        new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    workers = os.cpu_count() or 1
    study = step_study(system, tolerance, workers=workers, progress=True, of=of, metrics=metrics)
    if out:
        write_text(out / "step_study.json", json.dumps(study.as_json(), indent=2) + "\n")
    if plot:
        path = (out or Path()) / "step_study.png"
        draw_step_study(study, path)
        click.echo(f"drew {path}", err=True)
    click.echo(json.dumps(study.as_json()) if as_json else study.as_text())
    return 0 if study.holds else NEGATIVE
