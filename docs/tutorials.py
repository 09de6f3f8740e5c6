"""Does the runs that the tutorial pages list, fills in their tables and draws their pictures.

    .venv/bin/python docs/pictures.py limits your_plant     # in the folder of the checkout

A table below a command has a row for each value of the word that is its first heading. The other
headings say what is taken from the run: COLUMNS.
"""

import math
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
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
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.recording.result import Result
from grasp_cosim.report.plot import (
    BLUE,
    FINGER_STYLES,
    GREY,
    LINE_STYLES,
    RED,
    add_heading,
    finish_axes,
    legend_below,
    new_figure,
    save_figure,
)
from grasp_cosim.report.wording import Caption, about

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


def done(*words: str) -> None:
    """Do a command and keep what it prints to itself; SystemExit where it fails."""
    with redirect_stdout(StringIO()):
        code = cli.main(list(words))
    if code:
        raise SystemExit(f"grasp-cosim {shlex.join(words)}: exit code {code}")


def recorder(folder: Path) -> Do:
    """Do each line "grasp-cosim run ..." once, in the current folder.

    SystemExit where it fails.
    """

    @cache
    def run(*words: str) -> Result:
        out = folder / str(run.cache_info().misses)
        done(*words, "--out", str(out))
        return load_run(out)

    return lambda line: run(*_once(shlex.split(line)[1:]))


def _once(words: Sequence[str]) -> list[str]:
    """The words of a line; a place that a row of a table sets goes before the line's."""
    places = {k: w.partition("=")[0] for k, w in enumerate(words) if words[k - 1] == "--set"}
    last = {place: k for k, place in places.items()}
    gone = {k for k, place in places.items() if k != last[place]}
    return [word for k, word in enumerate(words) if not {k, k + 1} & gone]


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
    times: Any = run.metrics["time_to_contact"]
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
    "time difference, s": ("time_difference", 1.0, 3),
    "impacts, mm/s": ("impact_velocity", 1e3, 1),
    "peak forces, N": ("peak_contact_force", 1.0, 2),
    "learnt ratio": (learnt, 1.0, 3),
    "steady forces, N": ("steady_contact_force", 1.0, 2),
    "target position, mm": ("target_position", 1e3, 1),
    "object shift, mm": ("object_shift", 1e3, 2),
    "tilt, °": ("object_tilt", math.degrees(1.0), 2),
    "toppled": ("toppled", 1.0, 0),
    "squeeze, mm": ("squeeze", 1e3, 2),
    "damaged": ("damaged", 1.0, 0),
    "gap of the second finger, mm": (gap_behind, 1e3, 2),
    "object drift, mm/s": (drift, 1e3, 1),
    "remaining gap, mm": (lambda run: abs(run.signals["plant.gap[1]"][-1]), 1e3, 1),
    "Eq. (9), mm": (gap_by_equation_9, 1e3, 2),
    "formula, mm/s": (drift_by_equation_3, 1e3, 1),
    "blind range, mm": (blind_by_equation_9, 1e3, 1),
    "formula, mm": (gap_by_equation_7, 1e3, 1),
}
"""What the headings of the tables mean: a metric or a function of a run, its factor, the digits."""


# Pictures

_CASES = {"Case 0": ("-.", GREY), "Case 1": ("--", RED), "Case 2": ("-", BLUE)}
_LAYERS = {"0": "force only", "1": "+ impact reduction", "2": "+ simultaneous contact"}


@contextmanager
def _picture(
    path: Path, title: str, width: float, height: float, *grid: int, **shared: Any
) -> Iterator[Any]:
    """A grid of axes, saved as a picture under its title, the date and the version."""
    figure = new_figure(width, height)
    yield figure.subplots(*grid, squeeze=False, **shared)
    add_heading(figure, Caption(title, about(None)))
    save_figure(figure, path)


def draw_method(tables: Sequence[Runs], folder: Path) -> None:
    """All pictures of method.md."""
    cases, box, tall, cup = tables
    draw_layers(cases, folder / "layers.png")
    draw_objects(_plain(box), _plain(tall), _plain(cup), folder / "objects.png")


def draw_adaptive_law(tables: Sequence[Runs], folder: Path) -> None:
    """All pictures of adaptive_law.md."""
    reflectances, carried, laws = (_plain(runs) for runs in tables)
    draw_unequal_faces(reflectances, carried, folder / "unequal_faces.png")
    draw_colour(laws, folder / "colour.png")


def draw_limits(tables: Sequence[Runs], folder: Path) -> None:
    """The picture of limits.md."""
    _, converter, _, friction, *_ = tables
    draw_failures(_plain(converter), _plain(friction), folder / "limits.png")


def _plain(runs: Runs) -> Runs:
    """The rows that set a number and nothing more."""
    return {value: run for value, run in runs.items() if " " not in value}


def _in_columns(rows: Any) -> None:
    """Label the values on the left and the time below, with one legend of all."""
    for axes in rows[:, 1:].flat:
        axes.set_ylabel("")
    for axes in rows[-1]:
        axes.set_xlabel("time in s")
    legend_below(rows[0, 0].figure)


def draw_layers(cases: Runs, path: Path) -> None:
    """The cases at a fixed object."""
    title, shared = "What each layer does, object fixed at 30 mm", {"sharex": True, "sharey": "row"}
    with _picture(path, title, 9.0, 7.0, 3, 3, **shared) as rows:
        for (case, layer), (gaps, forces, target) in zip(_LAYERS.items(), rows.T, strict=True):
            run = cases[f"--case {case}"]
            for j in FINGERS:
                gap = 1e3 * run.signals[f"plant.gap[{j}]"]
                gaps.plot(run.time, gap, FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}")
            finish_axes(gaps, "gap in mm", legend=False)
            draw_contact_forces(forces, run)
            draw_targets(target, [(run, "-", "")])
            gaps.set_title(f"Case {case}: {layer}", fontsize=10)
        _in_columns(rows)
        rows[1, 0].set_ylim(-0.2, 6.0)
        rows[2, 0].set_ylim(-5.0, 45.0)
        rows[2, 0].set_xlim(0.0, 3.0)


def draw_objects(box: Runs, tall: Runs, cup: Runs, path: Path) -> None:
    """The cases at two boxes and a cup."""
    title = "What each layer does to objects that move or give"
    with _picture(path, title, 9.0, 3.4, 1, 3) as ((left, middle, right),):
        left.set_title("light box", fontsize=10)
        middle.set_title("tall box, rough floor", fontsize=10)
        right.set_title("soft cup", fontsize=10)
        y = "position of the box in mm"
        _over_time(left, box, "plant.object_position", 1e3, "Case {}", y)
        degrees = math.degrees(1.0)
        _over_time(middle, tall, "plant.tilt", degrees, "Case {}", "tilt of the box in °")
        middle.axhline(-degrees * math.atan2(0.07, 0.1), color="black", ls=":", label="balance")
        _over_time(right, cup, "plant.squeeze", 1e3, "Case {}", "squeeze of the cup in mm")
        right.axhline(8.0, color="black", ls=":", label="damaged above")
        legend_below(left.figure)


def _over_time(
    axes: Any, runs: Runs, name: str, factor: float, label: str, y: str, *, legend: bool = False
) -> None:
    """A signal of all runs; the label has {} in the place of the value in the first column."""
    for plain, (value, run) in zip(LINE_STYLES, runs.items(), strict=False):
        named = label.format(value)
        style, colour = _CASES.get(named, (plain, BLUE))
        axes.plot(run.time, factor * run.signals[name], style, color=colour, label=named)
    axes.set_xlabel("time in s")
    finish_axes(axes, y, legend)


def draw_unequal_faces(reflectances: Runs, carried: Runs, path: Path) -> None:
    """The published law before unequal reflectances, the object fixed and free."""
    title = "Unequal faces and the published law"
    with _picture(path, title, 9.0, 3.6, 1, 2) as ((fixed, free),):
        ratios = [float(ratio) for ratio in reflectances]
        fixed.plot(ratios, [1e3 * gap_behind(r) for r in reflectances.values()], "o", color=BLUE)
        curve = np.geomspace(0.5, 2.0, 101)
        fixed.plot(curve, [1e3 * gap_at_equal_intensity(r) for r in curve], color=GREY)
        fixed.set_title("fixed object", fontsize=10)
        fixed.set_xlabel("reflectance of the right face / left face")
        finish_axes(fixed, "gap of the second finger\nat the first contact in mm", legend=False)
        fixed.legend(["simulated", "Eq. (9), equal intensities"], fontsize=8)
        free.set_title("free object, reflectances 0.86 / 1", fontsize=10)
        y = "position of the object in mm"
        _over_time(free, carried, "plant.object_position", 1e3, "{} kg", y, legend=True)


def draw_failures(converter: Runs, friction: Runs, path: Path) -> None:
    """A converter whose range is too small, and friction."""
    with _picture(path, "Where the method fails", 9.0, 3.6, 1, 2) as ((near, held),):
        for style, (volts, run) in zip(LINE_STYLES, converter.items(), strict=False):
            speed = 1e3 * CLOSING[1] * run.signals["plant.velocity[1]"]
            before = ~run.signals["plant.contact[1]"].astype(bool) & (speed > 0.0)
            before &= np.cumsum(~before & (run.time > 1.0)) == 0
            gap = 1e3 * run.signals["plant.gap[1]"][before]
            near.plot(gap, speed[before], style, color=BLUE, label=f"converter up to {volts} V")
        near.set_title("sensor saturated near the surface", fontsize=10)
        near.set_xlim(20.0, 0.0)
        near.set_ylim(0.0, 80.0)
        near.set_xlabel("gap of finger 1 in mm")
        finish_axes(near, "closing speed in mm/s")
        held.set_title("Coulomb friction of the fingers", fontsize=10)
        held.set_ylim(-1.0, 30.0)
        held.set_xlim(0.0, 8.0)
        _over_time(
            held, friction, "plant.gap[1]", 1e3, "{} N", "gap of finger 1 in mm", legend=True
        )


def draw_colour(laws: Runs, path: Path) -> None:
    """Black on the right and white on the left, under both laws."""
    title, shared = "Black and white faces under both laws", {"sharex": True, "sharey": "row"}
    with _picture(path, title, 9.0, 4.8, 2, 2, **shared) as rows:
        for (law, run), (gaps, forces) in zip(laws.items(), rows.T, strict=True):
            for j, face in zip(FINGERS, ("black", "white"), strict=True):
                how = {"color": COLOR[j], "label": f"finger {j}, {face} face"}
                gap = 1e3 * run.signals[f"plant.gap[{j}]"]
                force = abs(run.signals[f"plant.contact_force[{j}]"])
                gaps.plot(run.time, gap, FINGER_STYLES[j], **how)
                forces.plot(run.time, force, FINGER_STYLES[j], **how)
            finish_axes(gaps, "gap in mm", legend=False)
            finish_axes(forces, "contact force in N", legend=False)
            apart = run.metrics["time_difference"]
            gaps.set_title(f"black and white, {law} law: {apart:.2f} s apart", fontsize=10)
        _in_columns(rows)
        rows[0, 0].set_ylim(-0.5, 20.0)
        rows[1, 0].set_xlim(0.5, 4.0)


def draw_your_plant(tables: Sequence[Runs], folder: Path) -> None:
    """your_plant.png: the object on a spring, Cases 1 and 2."""
    with _picture(folder / "your_plant.png", "The object on a spring", 7.2, 3.2) as ((axes,),):
        place, y = "plant.object_position", "position of the object in mm"
        _over_time(axes, _plain(tables[0]), place, 1e3, "Case {}", y, legend=True)


PAGES: Mapping[str, Callable[[Sequence[Runs], Path], None]] = {
    "explanation/method": draw_method,
    "explanation/adaptive_law": draw_adaptive_law,
    "explanation/limits": draw_limits,
    "how_to/python_block": draw_your_plant,
}

BLOCKS = (TEMPLATE_FOLDER / "spring_plant.py", HERE / "moving_object.py")
"""What the pages build before they run it."""


def update(name: str, pictures: Path) -> None:
    """Work out a page again, and draw its pictures into a folder."""
    for block in BLOCKS:
        done("build", str(block))
    with TemporaryDirectory() as folder:
        page = HERE / f"{name}.md"
        text, tables = worked_out(page.read_text("utf-8"), recorder(Path(folder)))
        write_text(page, text)
        PAGES[name](tables, pictures)
