"""Does the runs that the tutorial pages list, fills in their tables and draws their pictures.

    .venv/bin/python docs/tutorials.py     # in the folder of the checkout; a minute or two

A table below a command has a row for each value of the word that is its first heading. The other
headings say what is taken from the run: COLUMNS.
"""

import math
import re
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from grasp_cosim import cli
from grasp_cosim.files import write_text
from grasp_cosim.grasp.metrics import CLOSING, FINGERS
from grasp_cosim.grasp.pictures import COLOR, draw_contact_forces, draw_targets
from grasp_cosim.recording.load import load_run
from grasp_cosim.recording.result import Result
from grasp_cosim.report.plot import BLUE, GREY, RED, finish, new_figure, save

HERE = Path(__file__).parent

Runs = Mapping[str, Result]
"""The runs of a table by the values in its first column."""

Do = Callable[[str], Result]
"""What a command line recorded."""

_TABLE = re.compile(r"```console\n\$ ((?:(?!```).)*)\n```\n\n((?:\|[^\n]*\n)+)", re.DOTALL)
_CASES = {"0": ("-.", GREY), "1": ("--", RED), "2": ("-", BLUE)}
_STYLES = ("-", "--", "-.", ":")


# Pages


def commands(page: str) -> list[dict[str, str]]:
    """For each table of a page the command of each row, by the value in its first column."""
    found = []
    for command, table in _TABLE.findall(page):
        head, _, *rows = map(_cells, table.splitlines())
        line = command.replace("\\\n", " ")
        values = [row[0].strip("`") for row in rows]
        found.append({value: re.sub(rf"\b{head[0]}\b", value, line) for value in values})
    return found


def filled(page: str, do: Do) -> str:
    """The text of a page with the cells of its tables as the runs give them."""
    tables = iter(commands(page))

    def fill(match: re.Match[str]) -> str:
        lines = match[2].splitlines()
        heads = _cells(lines[0])
        for i, line in enumerate(next(tables).values(), start=2):
            values = [COLUMNS[head](do(line)) for head in heads[1:]]
            lines[i] = f"| {' | '.join([_cells(lines[i])[0], *values])} |"
        return f"```console\n$ {match[1]}\n```\n\n" + "\n".join(lines) + "\n"

    return _TABLE.sub(fill, page)


def tables_of(page: str, do: Do) -> list[Runs]:
    """The runs of each table of a page."""
    return [{value: do(line) for value, line in table.items()} for table in commands(page)]


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


class Recorder:
    """Does each command line once, in the current folder, and keeps what it recorded."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._runs: dict[str, Result] = {}

    def __call__(self, line: str) -> Result:
        """The run of a line "grasp-cosim run ..."; SystemExit where it fails."""
        words = shlex.split(line)
        key = shlex.join(words)
        if key not in self._runs:
            out = self._folder / str(len(self._runs))
            with redirect_stdout(StringIO()):
                code = cli.main([*words[1:], "--out", str(out)])
            if code:
                raise SystemExit(f"{key}: exit code {code}")
            self._runs[key] = load_run(out)
        return self._runs[key]


# Columns


def _pair(key: str, factor: float, digits: int) -> Callable[[Result], str]:
    return lambda run: " / ".join(_number(v, factor, digits) for v in run.metrics[key])


def _single(key: str, factor: float, digits: int) -> Callable[[Result], str]:
    return lambda run: _number(run.metrics[key], factor, digits)


def _number(value: float | None, factor: float, digits: int) -> str:
    """A rounded number without a sign where it is 0; none: it never was, or cannot be told."""
    return "none" if value is None else f"{round(factor * value, digits) + 0.0:.{digits}f}"


def _largest(name: str, factor: float, digits: int) -> Callable[[Result], str]:
    return lambda run: _number(float(np.abs(run.signals[name]).max()), factor, digits)


def _at_the_end(name: str) -> Callable[[Result], str]:
    return lambda run: "yes" if run.signals[name][-1] else "no"


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


def gap_left(run: Result) -> float:
    """The gap of finger 1 at the end, m."""
    return float(run.signals["plant.gap[1]"][-1])


def gap_by_equation_9(run: Result) -> float:
    """The gap of the second finger at the first contact where both intensities are equal, m."""
    gain = value(run, "sensor_1.gain", 0.0024) / 0.0024
    return gap_at_equal_intensity(gain * value(run, "sensor_1.reflectance", 1.0))


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


COLUMNS: Mapping[str, Callable[[Result], str]] = {
    "contacts, s": _pair("time_to_contact", 1.0, 3),
    "apart, s": _single("time_difference", 1.0, 3),
    "impacts, mm/s": _pair("impact_velocity", 1e3, 1),
    "peak forces, N": _pair("peak_contact_force", 1.0, 2),
    "steady forces, N": _pair("steady_contact_force", 1.0, 2),
    "target at the end, mm": _single("target_position", 1e3, 1),
    "object shifted, mm": _single("object_shift", 1e3, 2),
    "tilt, °": _largest("plant.tilt", math.degrees(1.0), 2),
    "toppled": _at_the_end("plant.toppled"),
    "squeeze, mm": _largest("plant.squeeze", 1e3, 2),
    "damaged": _at_the_end("plant.damaged"),
    "gap of the other then, mm": lambda run: _number(gap_behind(run), 1e3, 2),
    "drift at the end, mm/s": lambda run: _number(drift(run), 1e3, 1),
    "gap left, mm": lambda run: _number(abs(gap_left(run)), 1e3, 1),
    "Eq. (9), mm": lambda run: _number(gap_by_equation_9(run), 1e3, 2),
    "formula, mm/s": lambda run: _number(drift_by_equation_3(run), 1e3, 1),
    "blind below, mm": lambda run: _number(blind_by_equation_9(run), 1e3, 1),
    "formula, mm": lambda run: _number(gap_by_equation_7(run), 1e3, 1),
}
"""What the headings of the tables mean."""


# Pictures


def draw_layers(tables: Sequence[Runs], folder: Path) -> None:
    """layers.png, the cases at a fixed object; objects.png, at a box and a cup."""
    cases, box, tall, cup = (*tables[:3], _plain(tables[3]))
    figure = new_figure(9.0, 7.0)
    rows = figure.subplots(3, 3, sharex=True, sharey="row")
    for case, column in zip("012", rows.T, strict=True):
        run = cases[f"--case {case}"]
        gaps, forces, target = column
        for j in FINGERS:
            gap = 1e3 * run.signals[f"plant.gap[{j}]"]
            gaps.plot(run.time, gap, "-" if j == 1 else "--", color=COLOR[j], label=f"finger {j}")
        finish(gaps, "gap in mm")
        draw_contact_forces(forces, [(run, "-", "")])
        draw_targets(target, [(run, "-", "")])
        gaps.set_title(f"Case {case}: {_LAYERS[case]}", fontsize=10)
        target.set_xlabel("time in s")
    for axes in rows[:, 1:].flat:
        axes.set_ylabel("")
    rows[1, 0].set_ylim(-0.2, 6.0)
    rows[2, 0].set_ylim(-5.0, 45.0)
    rows[2, 0].set_xlim(0.0, 3.0)
    save(figure, folder / "layers.png")

    figure = new_figure(9.0, 3.4)
    left, middle, right = figure.subplots(1, 3)
    _over_time(left, box, "plant.object_position", 1e3)
    finish(left, "position of the box in mm")
    _over_time(middle, tall, "plant.tilt", math.degrees(1.0))
    middle.axhline(-math.degrees(math.atan2(0.07, 0.1)), color="black", ls=":", label="balance")
    finish(middle, "tilt of the box in °")
    _over_time(right, cup, "plant.squeeze", 1e3)
    right.axhline(8.0, color="black", ls=":", label="damaged above")
    finish(right, "squeeze of the cup in mm")
    for axes, title in zip(
        (left, middle, right), ("light box", "tall box, rough floor", "soft cup"), strict=True
    ):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("time in s")
    save(figure, folder / "objects.png")


_LAYERS = {"0": "force alone", "1": "+ impact reduction", "2": "+ simultaneous contact"}


def _over_time(axes: Any, runs: Runs, name: str, factor: float) -> None:
    for case, run in runs.items():
        style, colour = _CASES[case]
        axes.plot(run.time, factor * run.signals[name], style, color=colour, label=f"Case {case}")


def draw_limits(tables: Sequence[Runs], folder: Path) -> None:
    """limits.png: unequal reflectances, fixed and free; a converter too small; friction."""
    reflectances, carried, converter, _, friction, *_ = tables
    figure = new_figure(9.0, 7.0)
    (top_left, top_right), (bottom_left, bottom_right) = figure.subplots(2, 2)
    reflectances, converter, friction = map(_plain, (reflectances, converter, friction))
    ratios = [float(ratio) for ratio in reflectances]
    top_left.plot(ratios, [1e3 * gap_behind(r) for r in reflectances.values()], "o", color=BLUE)
    curve = np.geomspace(0.5, 2.0, 101)
    top_left.plot(curve, [1e3 * gap_at_equal_intensity(r) for r in curve], color=GREY)
    top_left.legend(["simulated", "Eq. (9), equal intensities"], fontsize=8)
    top_left.set_xlabel("reflectance of the right face / left face")
    finish(top_left, "gap of the second finger\nat the first contact in mm", legend=False)
    top_left.set_title("unequal reflectances, fixed object", fontsize=10)
    for style, (mass, run) in zip(_STYLES, carried.items(), strict=False):
        x = 1e3 * run.signals["plant.object_position"]
        top_right.plot(run.time, x, style, color=BLUE, label=f"{float(mass):g} kg")
    top_right.set_xlabel("time in s")
    finish(top_right, "position of the object in mm")
    top_right.set_title("reflectances 0.86 / 1, free object", fontsize=10)
    for style, (volts, run) in zip(_STYLES, converter.items(), strict=False):
        speed = 1e3 * CLOSING[1] * run.signals["plant.velocity[1]"]
        free = ~run.signals["plant.contact[1]"].astype(bool) & (speed > 0.0)
        free &= np.cumsum(~free & (run.time > 1.0)) == 0
        gap = 1e3 * run.signals["plant.gap[1]"][free]
        bottom_left.plot(gap, speed[free], style, color=BLUE, label=f"converter up to {volts} V")
    bottom_left.set_xlim(20.0, 0.0)
    bottom_left.set_ylim(0.0, 80.0)
    bottom_left.set_xlabel("gap of finger 1 in mm")
    finish(bottom_left, "closing speed in mm/s")
    bottom_left.set_title("sensor saturated near the surface", fontsize=10)
    for style, (force, run) in zip(_STYLES, friction.items(), strict=False):
        gap = 1e3 * run.signals["plant.gap[1]"]
        bottom_right.plot(run.time, gap, style, color=BLUE, label=f"{force} N")
    bottom_right.set_ylim(-1.0, 30.0)
    bottom_right.set_xlim(0.0, 8.0)
    bottom_right.set_xlabel("time in s")
    finish(bottom_right, "gap of finger 1 in mm")
    bottom_right.set_title("Coulomb friction of the fingers", fontsize=10)
    save(figure, folder / "limits.png")


def _plain(runs: Runs) -> Runs:
    """The rows that set a number and nothing more."""
    return {value: run for value, run in runs.items() if " " not in value}


def draw_your_plant(tables: Sequence[Runs], folder: Path) -> None:
    """your_plant.png: the object on a spring, Cases 1 and 2."""
    cases = _plain(tables[0])
    figure = new_figure(7.2, 3.2)
    axes = figure.subplots()
    _over_time(axes, cases, "plant.object_position", 1e3)
    axes.set_xlabel("time in s")
    finish(axes, "position of the object in mm")
    save(figure, folder / "your_plant.png")


PAGES: Mapping[str, Callable[[Sequence[Runs], Path], None]] = {
    "layers": draw_layers,
    "limits": draw_limits,
    "your_plant": draw_your_plant,
}


def main() -> None:
    """Update the pages and their pictures."""
    if code := cli.main(["build", str(HERE / "spring_plant.py")]):
        sys.exit(code)
    with TemporaryDirectory() as folder:
        recorder = Recorder(Path(folder))
        for name, draw in PAGES.items():
            page = HERE / f"{name}.md"
            text = filled(page.read_text("utf-8"), recorder)
            write_text(page, text)
            draw(tables_of(text, recorder), HERE)


if __name__ == "__main__":
    main()
