"""The step study of the command run."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ..convergence.step_study import step_study
from ..errors import InputError
from ..files import of_any_format, remove, write_json
from ..metrics.metric import Metric
from ..report.step_study import draw_step_study
from ..system.description import System
from .frame import NEGATIVE, check_outputs, is_quiet, say, show, together, waiting
from .native import natively

step_study_options = together(
    click.option(
        "--step-study", is_flag=True, help="Repeat the run over steps: is --step small enough?"
    ),
    click.option(
        "--of", "quantities", multiple=True, help="Metric or signal that a step study is about."
    ),
    click.option(
        "--tolerance", type=float, help="Of a step study, in the unit of --of; 1e-3 s for times."
    ),
)


def check_step_study(given: Mapping[str, Any], paced: bool) -> None:
    """InputError where options do not go together; `given` are all of a command by name."""
    if given["step_study"]:
        if paced:
            raise InputError("--realtime: must not come with --step-study, which is not paced")
    elif given["tolerance"] is not None:
        raise InputError(f"--tolerance {given['tolerance']!r}: must come with --step-study")
    elif given["quantities"]:
        raise InputError(f"--of {given['quantities'][0]}: must come with --step-study")


def study_step(
    system: System, metrics: Sequence[Metric], given: Mapping[str, Any], as_json: bool
) -> int:
    """Study the step of a system, print and write what was found, return the exit code.

    0 where the system's own step keeps what is asked about within the tolerance, else NEGATIVE.
    Of the options `given`, out is the folder for step_study.json; plot draws step_study.png there
    or in the current folder.
    """
    of, tolerance = given["quantities"], given["tolerance"]
    check_outputs(given["out"], given["plot"])
    workers = os.cpu_count() or 1
    with natively(system, given["native"]) as chosen:
        study = step_study(
            chosen, tolerance, workers=workers, progress=not is_quiet(), of=of, metrics=metrics
        )
    folder = given["out"] or Path()
    if given["out"]:
        remove(folder, "step_study.json", *of_any_format("step_study"))
        write_json(folder / "step_study.json", study.as_json())
    if given["plot"]:
        picture = folder / f"step_study.{given['suffix']}"
        with waiting("drawing"):
            draw_step_study(study, picture)
        say(f"drew {picture}")
    show(as_json, study.as_json(), study.as_text())
    return 0 if study.holds else NEGATIVE
