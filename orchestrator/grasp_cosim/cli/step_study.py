"""The step study of the command run."""

import json
import os
from pathlib import Path

import click

from ..convergence.step_study import TOLERANCE, check_study, step_study
from ..files import check_folder, write_text
from ..report.plot import new_figure
from ..report.step_study import draw_step_study
from ..system.description import System
from .frame import NEGATIVE


def run_step_study(
    system: System, tolerance: float | None, out: Path | None, plot: bool, as_json: bool
) -> int:
    """Study the step of a system, print and write what was found, return the exit code.

    0 where the system's own step keeps the contact times within the tolerance in s, else NEGATIVE;
    None stands for TOLERANCE.
    out is the folder for step_study.json, plot draws step_study.png there or in the current folder.
    """
    tolerance = TOLERANCE if tolerance is None else tolerance
    check_study(system, tolerance)
    if out or plot:
        check_folder(out or Path())
    if plot:
        new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    study = step_study(system, tolerance, workers=os.cpu_count() or 1, progress=True)
    if out:
        write_text(out / "step_study.json", json.dumps(study.as_json(), indent=2) + "\n")
    if plot:
        path = (out or Path()) / "step_study.png"
        draw_step_study(study, path)
        click.echo(f"drew {path}", err=True)
    click.echo(json.dumps(study.as_json()) if as_json else study.as_text())
    return 0 if study.holds else NEGATIVE
