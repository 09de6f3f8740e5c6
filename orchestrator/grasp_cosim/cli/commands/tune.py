"""The command tune."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ...errors import InputError
from ...files import remove, write_json, write_text
from ...grasp import tuning as of_grasp
from ...grasp.published.report import table_csv
from ...report.tuning import check_drawable, draw_tuning
from ...system.description import System
from ...tuning import words
from ...tuning.problem import Condition, Gain, Problem
from ...tuning.search import Tuning
from ...tuning.search import tune as search
from ..frame import (
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    format_option,
    is_quiet,
    json_option,
    metrics_option,
    pair,
    say,
    show,
    workers_option,
)
from ..native import all_natively, many_runs_option
from ..options import chosen_system, set_values, system_options

FILES = ("tuning.json", "tuned.toml", "points.csv")


@click.command()
@click.argument("system", required=False, type=PATH)
@system_options
@click.option(
    "--minimise",
    default=of_grasp.defaults()["minimise"],
    show_default=True,
    metavar="METRIC",
    help="What is to be least: until both forces have settled, or another metric.",
)
@click.option(
    "--vary",
    multiple=True,
    metavar="VARIABLE[,VARIABLE]=LOW:HIGH",
    help="A gain and its bounds; others keep their ratio to it. Default: seven, within a factor 3.",
)
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="METRIC[=MOST]",
    help="The most that a metric may be, in SI units; without it, what the system's own gains "
    "reach. Default: impact_velocity, time_difference and force_overshoot; =none drops one.",
)
@click.option(
    "--condition",
    "conditions",
    multiple=True,
    metavar="VARIABLE=VALUE[,...]",
    help="What the gains are for; the worst counts. Default: an object at 0 and 50 mm, and at "
    "20 mm with noisy sensors.",
)
@click.option(
    "--budget",
    type=int,
    default=1000,
    show_default=True,
    help="Sets of gains at most, each run in each condition.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=1,
    show_default=True,
    help="Of the search: another one, other gains.",
)
@workers_option
@click.option("--out", type=PATH, help=f"Folder for {', '.join(FILES)}.")
@click.option("--plot", is_flag=True, help="Draw tuning.png, in --out or the current folder.")
@format_option
@metrics_option
@many_runs_option
@json_option
def tune(as_json: bool, **given: Any) -> int:
    """Find the gains that grasp fastest within limits.

    SYSTEM is a .toml or .ssp file; by default the built-in grasp. Fast is the time until the forces
    of both fingers have settled; what counts of it, and of each limit, is the worst over fingers
    and conditions. The runs are of 4 s in steps of 1 ms, unless --step and --stop say otherwise.

    The search is a differential evolution: the same seed and budget, the same result, on any number
    of workers; a better one may exist. What was found is then run where it was not tuned, with
    other noise and friction, too. Exit code 1: no gains keep the limits, or one breaks in those
    checks that the system's own gains keep there.

    \b
    Example: grasp-cosim tune --limit impact_velocity=0.01 --out tuned --plot
    """
    out: Path | None = given["out"]
    problem = _problem(given)
    if given["plot"]:
        check_drawable(problem.limits)
    check_outputs(out, given["plot"])
    conditions = (*problem.conditions, *problem.checks)
    with all_natively([c.system for c in conditions], given["native"]) as systems:
        chosen = tuple(Condition(c.name, s) for c, s in zip(conditions, systems, strict=True))
        count = len(problem.conditions)
        run = replace(problem, conditions=chosen[:count], checks=chosen[count:])
        found = search(run, given["budget"], given["seed"], given["workers"], not is_quiet())
    start = "published" if of_grasp.is_published(problem.system, problem.gains) else "as it is"
    _write(found, out)
    if given["plot"]:
        picture = (out or Path()) / f"tuning.{given['suffix']}"
        draw_tuning(found, picture, start)
        say(f"drew {picture}")
    show(as_json, words.as_json(found), words.as_text(found, start))
    return NEGATIVE if found.tuned is None or _worse(found) else 0


def _problem(given: dict[str, Any]) -> Problem:
    """The problem of the options, with the grasp's own defaults where there are none."""
    defaults = of_grasp.defaults()
    step, stop = given["step"] or defaults["step"], given["stop"] or defaults["stop"]
    settings = set_values(given["settings"])
    system = chosen_system({**given, "step": step, "stop": stop})
    system = system.revised({}, settings, ("--swap", "--set"))
    gains = tuple(_gain(text) for text in given["vary"]) or of_grasp.default_gains(system)
    conditions = tuple(_condition(system, text) for text in given["conditions"])
    checks, left_out = of_grasp.default_checks(system)
    for line in left_out:
        say(line)
    return Problem(
        gains,
        given["minimise"],
        _limits(given["limits"]),
        conditions or of_grasp.default_conditions(system),
        checks,
        (of_grasp.grasp_time, *chosen_metrics(given["metric_files"])),
    )


def _gain(text: str) -> Gain:
    names, bounds = pair("--vary", text, "VARIABLE[,VARIABLE]=LOW:HIGH")
    try:
        low, high = map(float, bounds.split(":"))
        return Gain(tuple(names.split(",")), low, high)
    except ValueError as error:
        raise InputError(f"--vary {text!r}: must be VARIABLE[,VARIABLE]=LOW:HIGH") from error


def _limits(texts: Sequence[str]) -> dict[str, float | None]:
    """The limits by default, and those of --limit."""
    own: dict[str, float | None] = {}
    dropped = set()
    for text in texts:
        name, _, most = text.partition("=")
        if most == "none":
            dropped.add(name)
            continue
        try:
            own[name] = float(most) if most else None
        except ValueError as error:
            raise InputError(
                f"--limit {text!r}: must be METRIC, METRIC=MOST or METRIC=none"
            ) from error
    found = {**of_grasp.default_limits(), **own}
    return {name: most for name, most in found.items() if name not in dropped}


def _condition(system: System, text: str) -> Condition:
    form = "VARIABLE=VALUE[,VARIABLE=VALUE]"
    values = dict(pair("--condition", part, form) for part in text.split(","))
    return Condition(text, system.revised({}, values, ("--swap", "--condition")))


def _worse(found: Tuning) -> bool:
    """True if the new gains break a limit in a check that those before keep there."""
    return any(
        set(c.tuned.broken(found.limits)) - set(c.start.broken(found.limits)) for c in found.checks
    )


def _write(found: Tuning, out: Path | None) -> None:
    if out:
        remove(out, *FILES)
        write_json(out / "tuning.json", words.as_json(found))
        write_text(out / "points.csv", table_csv(words.rows(found)))
        if found.tuned:
            write_text(out / "tuned.toml", words.preset_toml(found, found.tuned))
