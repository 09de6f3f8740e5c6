"""Does the runs that the tutorial pages list, fills in their tables and draws their pictures.

    .venv/bin/python docs/tutorials.py     # in the folder of the checkout; a minute or two

A table below a command has a row for each value of the word that is its first heading. The other
headings say what is taken from the run: COLUMNS.
"""

import math
import os
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from grasp_cosim import cli
from grasp_cosim.base.files import write_text
from grasp_cosim.grasp.metrics import CLOSING, FINGERS
from grasp_cosim.grasp.pictures import COLOR, draw_contact_forces, draw_targets
from grasp_cosim.recording.load import load_run
from grasp_cosim.recording.result import Result
from grasp_cosim.report.caption import Caption, about
from grasp_cosim.report.plot import (
    BLUE,
    DASHES,
    GREY,
    RED,
    finish,
    headed,
    new_figure,
    one_legend,
    save,
)
from matplotlib.figure import Figure

HERE = Path(__file__).parent

DATE = "1795435200"
"""On the pictures, as SOURCE_DATE_EPOCH, so that they are the same at any time: 2026-11-23."""

Runs = Mapping[str, Result]
"""The runs of a table by the values in its first column."""

Do = Callable[[str], Result]
"""What a command line recorded."""

_TABLE = re.compile(r"```console\n\$ ((?:(?!```).)*)\n```\n\n((?:\|[^\n]*\n)+)", re.DOTALL)


# Pages


def worked_out(page: str, do: Do) -> tuple[str, list[Runs]]:
    """The text of a page with the cells of its tables as the runs give them, and those runs."""
    tables: list[Runs] = []

    def fill(match: re.Match[str]) -> str:
        command, table = match.groups()
        head, rule, *rows = table.splitlines()
        word, *heads = _cells(head)
        firsts = [_cells(row)[0] for row in rows]
        line = command.replace("\\\n", " ")
        runs = {v: do(re.sub(rf"\b{word}\b", v, line)) for v in (f.strip("`") for f in firsts)}
        tables.append(runs)
        filled = [
            f"| {' | '.join([first, *(_cell(heading, run) for heading in heads)])} |"
            for first, run in zip(firsts, runs.values(), strict=True)
        ]
        return "\n".join(["```console", f"$ {command}", "```", "", head, rule, *filled, ""])

    return _TABLE.sub(fill, page), tables


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def recorder(folder: Path) -> Do:
    """Do each line "grasp-cosim run ..." once, in the current folder.

    SystemExit where it fails.
    """

    @cache
    def run(*words: str) -> Result:
        out = folder / str(run.cache_info().misses)
        with redirect_stdout(StringIO()):
            code = cli.main([*words[1:], "--out", str(out)])
        if code:
            raise SystemExit(f"{shlex.join(words)}: exit code {code}")
        return load_run(out)

    return lambda line: run(*_once(shlex.split(line)))


def _once(words: Sequence[str]) -> list[str]:
    """The words of a line; a place or option that a row of a table sets goes before the line's."""
    kept: dict[str, list[str]] = {}
    for k, word in enumerate(words):
        if word == "--set":
            kept[words[k + 1].partition("=")[0]] = [word, words[k + 1]]
        elif word == "--controller":
            kept[word] = [word, words[k + 1]]
        elif k == 0 or words[k - 1] not in ("--set", "--controller"):
            kept[f"{k} {word}"] = [word]
    return [word for pair in kept.values() for word in pair]


# Columns


def _cell(heading: str, run: Result) -> str:
    quantity, factor, digits = COLUMNS[heading]
    found = run.metrics[quantity] if isinstance(quantity, str) else quantity(run)
    each = found if isinstance(found, list | tuple) else [found]
    return " / ".join(_text(value, factor, digits) for value in each)


def _text(value: float | bool | None, factor: float, digits: int) -> str:
    """A rounded number without a sign where it is 0; none: it never was, or cannot be told."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "none" if value is None else f"{round(factor * value, digits) + 0.0:.{digits}f}"


def value(run: Result, name: str, otherwise: float) -> float:
    """What a run set a variable to, or otherwise."""
    component, _, variable = name.partition(".")
    return float(run.settings["components"][component]["values"].get(variable, otherwise))


def gap_behind(run: Result) -> float:
    """The gap of the second finger at the moment of the first contact, m."""
    times = run.metrics["time_to_contact"]
    later = 1 + times.index(max(times))
    return float(np.interp(min(times), run.time, run.signals[f"plant.gap[{later}]"]))


def drift(run: Result) -> float:
    """The speed of the object over the last half second, m/s."""
    end = float(run.time[-1])
    x = np.interp([end - 0.5, end], run.time, run.signals["plant.object_position"])
    return float(x[1] - x[0]) / 0.5


def gap_by_equation_9(run: Result) -> float:
    """The gap of the second finger at the first contact where both intensities are equal, m."""
    gain = value(run, "sensor_1.gain", 0.0024) / 0.0024
    right, left = (value(run, f"sensor_{j}.reflectance", 1.0) for j in FINGERS)
    return gap_at_equal_intensity(gain * right / left)


def gap_at_equal_intensity(ratio: float) -> float:
    """How far in m one finger is when the other touches a face that is ratio times as bright."""
    return 0.005 * math.pow(max(ratio, 1.0 / ratio), 1.0 / 1.1506) - 0.005


def drift_by_equation_3(run: Result) -> float:
    """The speed at which the target stays ahead of the middle, as far as friction makes it, m/s."""
    ratio = value(run, "sensor_1.reflectance", 1.0)
    m_g = value(run, "plant.object_mass", 0.05) * 9.80665
    f_s, floor_friction = 3.0 * math.tanh((ratio - 1.0) / (ratio + 1.0)), 0.3
    ahead = floor_friction * m_g / (2.0 * 98.0)
    return math.copysign(max(0.0, abs(f_s) - 36.0 * ahead) / 12.0, f_s)


def blind_by_equation_9(run: Result) -> float:
    """The gap in m below which the sensor is at the upper end of its converter; 0 where none."""
    gain, highest = value(run, "sensor_1.gain", 0.0024), value(run, "sensor_1.adc.range[2]", 10.0)
    return max(0.0, math.pow(gain / highest, 1.0 / 1.1506) - 0.005)


def gap_by_equation_7(run: Result) -> float:
    """The gap in m at which friction holds a finger against layer 1; 0 where it does not."""
    stiffness = value(run, "controller.contact_force.stiffness", 98.0)
    return max(0.0, value(run, "plant.friction.coulomb[1]", 0.0) / stiffness - 0.035)


def learnt(run: Result) -> float | None:
    """The ratio of the reflectances at the end, as learnt; None where nothing learns."""
    ratio = run.signals.get("controller.reflectance_ratio")
    return None if ratio is None else float(ratio[-1])


COLUMNS: Mapping[str, tuple[str | Callable[[Result], float | list[float] | None], float, int]] = {
    "contacts, s": ("time_to_contact", 1.0, 3),
    "apart, s": ("time_difference", 1.0, 3),
    "impacts, mm/s": ("impact_velocity", 1e3, 1),
    "peak forces, N": ("peak_contact_force", 1.0, 2),
    "ratio learnt": (learnt, 1.0, 3),
    "steady forces, N": ("steady_contact_force", 1.0, 2),
    "target at the end, mm": ("target_position", 1e3, 1),
    "object shifted, mm": ("object_shift", 1e3, 2),
    "tilt, °": ("object_tilt", math.degrees(1.0), 2),
    "toppled": ("toppled", 1.0, 0),
    "squeeze, mm": ("squeeze", 1e3, 2),
    "damaged": ("damaged", 1.0, 0),
    "gap of the other then, mm": (gap_behind, 1e3, 2),
    "drift at the end, mm/s": (drift, 1e3, 1),
    "gap left, mm": (lambda run: abs(run.signals["plant.gap[1]"][-1]), 1e3, 1),
    "Eq. (9), mm": (gap_by_equation_9, 1e3, 2),
    "formula, mm/s": (drift_by_equation_3, 1e3, 1),
    "blind below, mm": (blind_by_equation_9, 1e3, 1),
    "formula, mm": (gap_by_equation_7, 1e3, 1),
}
"""What the headings of the tables mean: a metric or a function of a run, its factor, the digits."""


# Pictures

_CASES = {"Case 0": ("-.", GREY), "Case 1": ("--", RED), "Case 2": ("-", BLUE)}
_LAYERS = {"0": "force alone", "1": "+ impact reduction", "2": "+ simultaneous contact"}
_STYLES = ("-", "--", "-.", ":")


def draw_pictures(tables: Sequence[Runs], folder: Path) -> None:
    """All pictures of limits.md."""
    cases, box, tall, cup, reflectances, carried, laws, _, converter, _, friction, *_ = tables
    draw_layers(cases, folder)
    draw_objects(_plain(box), _plain(tall), _plain(cup), folder)
    each = (reflectances, carried, converter, friction)
    draw_limits([_plain(runs) for runs in each], folder)
    draw_colour(_plain(laws), folder)


def draw_layers(cases: Runs, folder: Path) -> None:
    """layers.png, the cases at a fixed object."""
    figure = new_figure(9.0, 7.0)
    rows = figure.subplots(3, 3, sharex=True, sharey="row")
    for case, column in zip("012", rows.T, strict=True):
        run = cases[f"--case {case}"]
        gaps, forces, target = column
        for j in FINGERS:
            gap = 1e3 * run.signals[f"plant.gap[{j}]"]
            gaps.plot(run.time, gap, DASHES[j], color=COLOR[j], label=f"finger {j}")
        finish(gaps, "gap in mm", legend=False)
        draw_contact_forces(forces, run)
        draw_targets(target, [(run, "-", "")])
        gaps.set_title(f"Case {case}: {_LAYERS[case]}", fontsize=10)
        target.set_xlabel("time in s")
    for axes in rows[:, 1:].flat:
        axes.set_ylabel("")
    rows[1, 0].set_ylim(-0.2, 6.0)
    rows[2, 0].set_ylim(-5.0, 45.0)
    rows[2, 0].set_xlim(0.0, 3.0)
    one_legend(figure)
    _saved(figure, folder / "layers.png", "What each layer does, object fixed at 30 mm")


def draw_objects(box: Runs, tall: Runs, cup: Runs, folder: Path) -> None:
    """objects.png, the cases at two boxes and a cup."""
    figure = new_figure(9.0, 3.4)
    left, middle, right = figure.subplots(1, 3)
    _over_time(left, box, "plant.object_position", 1e3, "Case {}")
    _label(left, "time in s", "position of the box in mm", "light box", legend=False)
    _over_time(middle, tall, "plant.tilt", math.degrees(1.0), "Case {}")
    middle.axhline(-math.degrees(math.atan2(0.07, 0.1)), color="black", ls=":", label="balance")
    _label(middle, "time in s", "tilt of the box in °", "tall box, rough floor", legend=False)
    _over_time(right, cup, "plant.squeeze", 1e3, "Case {}")
    right.axhline(8.0, color="black", ls=":", label="damaged above")
    _label(right, "time in s", "squeeze of the cup in mm", "soft cup", legend=False)
    one_legend(figure)
    _saved(figure, folder / "objects.png", "What each layer does to objects that move or give")


def _saved(figure: Figure, path: Path, title: str) -> None:
    """Save a picture under its title, the date and the version."""
    headed(figure, Caption(title, about(None)))
    save(figure, path)


def _over_time(axes: Any, runs: Runs, name: str, factor: float, label: str) -> None:
    """A signal of all runs; the label has {} in the place of the value in the first column."""
    for plain, (value, run) in zip(_STYLES, runs.items(), strict=False):
        named = label.format(value)
        style, colour = _CASES.get(named, (plain, BLUE))
        axes.plot(run.time, factor * run.signals[name], style, color=colour, label=named)


def _label(axes: Any, x: str, y: str, title: str = "", *, legend: bool = True) -> None:
    axes.set_xlabel(x)
    axes.set_title(title, fontsize=10)
    finish(axes, y, legend)


def draw_limits(tables: Sequence[Runs], folder: Path) -> None:
    """limits.png: unequal reflectances, fixed and free; a converter too small; friction."""
    reflectances, carried, converter, friction = tables
    figure = new_figure(9.0, 7.0)
    (top_left, top_right), (bottom_left, bottom_right) = figure.subplots(2, 2)
    ratios = [float(ratio) for ratio in reflectances]
    top_left.plot(ratios, [1e3 * gap_behind(r) for r in reflectances.values()], "o", color=BLUE)
    curve = np.geomspace(0.5, 2.0, 101)
    top_left.plot(curve, [1e3 * gap_at_equal_intensity(r) for r in curve], color=GREY)
    top_left.legend(["simulated", "Eq. (9), equal intensities"], fontsize=8)
    _label(
        top_left,
        "reflectance of the right face / left face",
        "gap of the second finger\nat the first contact in mm",
        "unequal reflectances, fixed object",
        legend=False,
    )
    _over_time(top_right, carried, "plant.object_position", 1e3, "{} kg")
    _label(
        top_right, "time in s", "position of the object in mm", "reflectances 0.86 / 1, free object"
    )
    for style, (volts, run) in zip(_STYLES, converter.items(), strict=False):
        speed = 1e3 * CLOSING[1] * run.signals["plant.velocity[1]"]
        free = ~run.signals["plant.contact[1]"].astype(bool) & (speed > 0.0)
        free &= np.cumsum(~free & (run.time > 1.0)) == 0
        gap = 1e3 * run.signals["plant.gap[1]"][free]
        bottom_left.plot(gap, speed[free], style, color=BLUE, label=f"converter up to {volts} V")
    bottom_left.set_xlim(20.0, 0.0)
    bottom_left.set_ylim(0.0, 80.0)
    _label(
        bottom_left,
        "gap of finger 1 in mm",
        "closing speed in mm/s",
        "sensor saturated near the surface",
    )
    _over_time(bottom_right, friction, "plant.gap[1]", 1e3, "{} N")
    bottom_right.set_ylim(-1.0, 30.0)
    bottom_right.set_xlim(0.0, 8.0)
    _label(bottom_right, "time in s", "gap of finger 1 in mm", "Coulomb friction of the fingers")
    _saved(figure, folder / "limits.png", "Where the method fails")


def draw_colour(laws: Runs, folder: Path) -> None:
    """colour.png: black on the right and white on the left, under both laws."""
    figure = new_figure(9.0, 4.8)
    rows = figure.subplots(2, 2, sharex=True, sharey="row")
    for (law, run), column in zip(laws.items(), rows.T, strict=True):
        gaps, forces = column
        for j, style in DASHES.items():
            face = "black" if j == 1 else "white"
            label = f"finger {j}, {face} face"
            gap = 1e3 * run.signals[f"plant.gap[{j}]"]
            force = abs(run.signals[f"plant.contact_force[{j}]"])
            gaps.plot(run.time, gap, style, color=COLOR[j], label=label)
            forces.plot(run.time, force, style, color=COLOR[j], label=label)
        finish(gaps, "gap in mm", legend=False)
        finish(forces, "contact force in N", legend=False)
        apart = run.metrics["time_difference"]
        gaps.set_title(f"black and white, {law} law: {apart:.2f} s apart", fontsize=10)
        forces.set_xlabel("time in s")
    for axes in rows[:, 1]:
        axes.set_ylabel("")
    rows[0, 0].set_ylim(-0.5, 20.0)
    rows[1, 0].set_xlim(0.5, 4.0)
    one_legend(figure)
    _saved(figure, folder / "colour.png", "Black and white faces under both laws")


def _plain(runs: Runs) -> Runs:
    """The rows that set a number and nothing more."""
    return {value: run for value, run in runs.items() if " " not in value}


def draw_your_plant(tables: Sequence[Runs], folder: Path) -> None:
    """your_plant.png: the object on a spring, Cases 1 and 2."""
    cases = _plain(tables[0])
    figure = new_figure(7.2, 3.2)
    axes = figure.subplots()
    _over_time(axes, cases, "plant.object_position", 1e3, "Case {}")
    _label(axes, "time in s", "position of the object in mm")
    _saved(figure, folder / "your_plant.png", "The object on a spring")


PAGES: Mapping[str, Callable[[Sequence[Runs], Path], None]] = {
    "limits": draw_pictures,
    "your_plant": draw_your_plant,
}


BLOCKS = ("spring_plant.py", "moving_object.py")
"""What the pages build before they run it."""


def update(name: str, pictures: Path) -> None:
    """Work out a page anew, and draw its pictures into a folder."""
    with TemporaryDirectory() as folder:
        page = HERE / f"{name}.md"
        text, tables = worked_out(page.read_text("utf-8"), recorder(Path(folder)))
        write_text(page, text)
        PAGES[name](tables, pictures)


def main() -> None:
    """Update the pages and their pictures."""
    os.environ["SOURCE_DATE_EPOCH"] = DATE
    build_blocks()
    for name in PAGES:
        update(name, HERE)


def build_blocks() -> None:
    """Build what the pages run; SystemExit where that fails."""
    for block in BLOCKS:
        if code := cli.main(["build", str(HERE / block)]):
            sys.exit(code)


if __name__ == "__main__":
    main()
