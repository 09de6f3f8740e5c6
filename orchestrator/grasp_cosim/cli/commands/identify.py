"""The command identify."""

from pathlib import Path

import click

from ...errors import InputError
from ...files import check_folder, remove, write_json, write_text
from ...grasp.identification import report
from ...grasp.identification.contact_times import (
    identify_from_times,
    published_contacts,
    read_contacts,
    scatter,
)
from ...grasp.identification.log import GROUPS as IN_A_LOG
from ...grasp.identification.log import identify_from_log
from ...grasp.identification.parameters import DEFAULT, GROUPS, chosen
from ...numerals import counted
from ...recording.load import load_log
from ...system.description import System
from ..frame import PATH, is_quiet, json_option, load_system, say, show, workers_option
from ..options import many_runs_option, natively, set_option, set_values


@click.command()
@click.option("--log", type=PATH, help="A recorded log, .csv or .mf4, to fit to.")
@click.option("--times", type=PATH, help="Contact times: x_m,case,finger,time as CSV.")
@click.option(
    "--fit",
    "groups",
    multiple=True,
    default=DEFAULT,
    show_default=True,
    metavar="|".join(GROUPS),
    help="What is fitted; may be given several times.",
)
@set_option
@click.option("--out", type=PATH, help="Folder for values and residuals.")
@workers_option
@many_runs_option
@json_option
def identify(
    log: Path | None,
    times: Path | None,
    groups: tuple[str, ...],
    settings: tuple[str, ...],
    out: Path | None,
    workers: int,
    native: bool | None,
    as_json: bool,
) -> int:
    """Fit the fingers' friction to contact times.

    By default these are the published experimental ones.

    \b
    Example: grasp-cosim identify --fit coulomb --fit viscous --out identified
    From a log: grasp-cosim identify --log results/signals.csv --fit coulomb
    """
    if log and times:
        raise InputError(f"--log {log}: must not come with --times, which is other data")
    if out:
        check_folder(out)
    system = load_system().with_settings(set_values(settings), "--set ".__add__)
    if log:
        found = _from_log(system, log, groups)
    else:
        found = _from_times(system, times, groups, workers, native)
    if out:
        remove(out, "identification.json", "values.toml", "residuals.csv")
        write_text(out / "values.toml", report.values_toml(found))
        write_text(out / "residuals.csv", report.residuals_csv(found))
        write_json(out / "identification.json", report.as_json(found))
    show(as_json, report.as_json(found), report.text(found))
    return 0


def _from_log(system: System, path: Path, groups: tuple[str, ...]) -> report.Identification:
    parameters = chosen(groups, IN_A_LOG, f"--log {path}")
    windows, fit = identify_from_log(system, load_log(path, say), parameters, str(path))
    rows = [{"finger": w.finger, "time": float(t)} for w in windows for t in w.time]
    return report.Identification(f"{path}, {counted(len(rows), 'window')}", "N", fit, rows)


def _from_times(
    system: System,
    path: Path | None,
    groups: tuple[str, ...],
    workers: int,
    native: bool | None,
) -> report.Identification:
    contacts = read_contacts(path) if path else published_contacts()
    parameters = chosen(groups, tuple(GROUPS), "identify")
    run = natively(system, native)
    fit = identify_from_times(run, contacts, parameters, workers, progress=not is_quiet())
    rows = [
        {"condition": c.label, "case": c.case, "finger": c.finger, "measured": c.time}
        for c in contacts
    ]
    name = str(path) if path else "the published experiments"
    data = f"{name}, {len(contacts)} contact times"
    return report.Identification(data, "s", fit, rows, scatter(contacts))
