"""The step study of the command run."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from ..convergence.step_study import ask, step_study
from ..errors import InputError
from ..files import check_folder, write_text
from ..metrics.metric import Metric
from ..report.plot import new_figure
from ..report.step_study import draw_step_study
from ..system.description import System
from .frame import NEGATIVE, together

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
"""The options of StepStudyOptions."""


@dataclass(frozen=True, slots=True)
class StepStudyOptions:
    """Whether the step is studied, of which metrics or signals, to which tolerance."""

    step_study: bool
    quantities: tuple[str, ...]
    tolerance: float | None

    def check(self, paced: bool) -> None:
        """InputError where options do not go together."""
        if self.tolerance is not None and not self.step_study:
            raise InputError(f"--tolerance {self.tolerance!r}: must come with --step-study")
        if self.quantities and not self.step_study:
            raise InputError(f"--of {self.quantities[0]}: must come with --step-study")
        if paced and self.step_study:
            raise InputError("--realtime: must not come with --step-study, which is not paced")

    def run(
        self,
        system: System,
        metrics: Sequence[Metric],
        out: Path | None,
        plot: bool,
        as_json: bool,
    ) -> int:
        """Study the step of a system, print and write what was found, return the exit code.

        0 where the system's own step keeps what is asked about within the tolerance, else NEGATIVE.
        `out` is the folder for step_study.json; `plot` draws step_study.png there or in the current
        folder.
        """
        ask(system, self.quantities, self.tolerance, metrics)
        if out or plot:
            check_folder(out or Path())
        if plot:
            new_figure(1.0, 1.0)  # says at once if matplotlib is missing
        workers = os.cpu_count() or 1
        study = step_study(
            system,
            self.tolerance,
            workers=workers,
            progress=True,
            of=self.quantities,
            metrics=metrics,
        )
        if out:
            write_text(out / "step_study.json", json.dumps(study.as_json(), indent=2) + "\n")
        if plot:
            path = (out or Path()) / "step_study.png"
            draw_step_study(study, path)
            click.echo(f"drew {path}", err=True)
        click.echo(json.dumps(study.as_json()) if as_json else study.as_text())
        return 0 if study.holds else NEGATIVE
