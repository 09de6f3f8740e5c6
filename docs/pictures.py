"""Makes the pictures in docs, each by the command or the runs that it shows.

    .venv/bin/python docs/pictures.py [NAME...]     # in the folder of the checkout; make pictures

Without a NAME, like hand or layers, all of them, in ten minutes. report.png and live.png take
Chromium, and timing.png a machine that is idle.
"""

import os
import re
import shutil
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import calibration_picture
import delicate_picture
import numpy as np
import tutorials
from browser import Browser, chromium
from grasp_cosim import hand_system, simulate, tandem_system
from grasp_cosim.base.files import write_text
from grasp_cosim.grasp.presets import with_case
from grasp_cosim.grasp.published.evaluation_page import figures
from grasp_cosim.grasp.published.reproduction import reproduce
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.hand.view import draw_hand as draw_three_fingers
from grasp_cosim.live.live_page import LivePage
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.report.plot import add_heading, new_figure, save_figure
from grasp_cosim.report.system_html import connections_svg, stand_alone
from grasp_cosim.report.wording import Caption, about
from grasp_cosim.system.settings import settings
from hand import hand_svg, tandem_svg, three_svg
from three_layers import three_layers_svg

HERE = Path(__file__).parent

THREE: dict[str, str | float] = {
    "plant.shape": "disc",
    "sensor_1.reflectance": 0.3,
    "sensor_2.reflectance": 1.2,
}
"""The hand of three_fingers.svg and .png: black, white, and a little brighter."""


def draw_hand(folder: Path) -> None:
    """hand.svg, the beginning of the README: the hand closes without and with layer 3."""
    rows = [
        (f"Case {case}: {title}", simulate(with_case(grasp_system(), case), every=10))
        for case, title in ((1, "without layer 3"), (2, "with layer 3"))
    ]
    write_text(folder / "hand.svg", hand_svg(rows))


def draw_first(folder: Path) -> None:
    """first_grasp.png and first_grasp_case_1.png: the runs of docs/start/first_grasp.md."""
    simulate(grasp_system()).plot(folder / "first_grasp.png")
    simulate(with_case(grasp_system(), 1)).plot(folder / "first_grasp_case_1.png")


def draw_three(folder: Path) -> None:
    """three_fingers.svg and .png: a hand closes on a disc with three colours, by both laws."""
    rows = []
    for title, law in (("published law", "published"), ("any colours", "adaptive")):
        system = hand_system(controller=law).with_values(THREE)
        rows.append((title, simulate(system, stop=3.0)))
    write_text(folder / "three_fingers.svg", three_svg(rows))
    draw_three_fingers(rows[1][1], folder / "three_fingers.png")


def draw_tandem(folder: Path) -> None:
    """tandem.svg: a gripper on an arm takes a free box, its wrist not moved and moved."""
    rows = [
        (title, simulate(with_case(tandem_system(), case), stop=3.0))
        for case, title in ((1, "wrist not moved"), (2, "wrist moved"))
    ]
    write_text(folder / "tandem.svg", tandem_svg(rows))


def draw_loop(folder: Path) -> None:
    """loop.svg: the FMUs of the built-in system and their connections, as `report` draws them."""
    system = grasp_system(native=False)
    units = simulate(system, stop=0.01).units
    write_text(folder / "loop.svg", f"{stand_alone(connections_svg(settings(system), units))}\n")


def draw_three_layers(folder: Path) -> None:
    """three_layers.svg: the diagram of docs/explanation/method.md."""
    write_text(folder / "three_layers.svg", three_layers_svg())


def _browser(width: int, height: int) -> Browser:
    """A window for the picture of a page."""
    if chromium() is None:
        raise SystemExit("chromium is not installed; it takes the pictures of pages")
    return Browser(width, height)


def draw_report(folder: Path) -> None:
    """report.png, the page of a run at the second contact, as Chromium shows it."""
    with TemporaryDirectory() as kept:
        page = Path(kept, "grasp/report.html")
        tutorials.done("run", "--native", "--out", str(page.parent))
        tutorials.done("report", str(page.parent))
        run = load_run(page.parent)
        times: Any = run.metrics["time_to_contact"]
        touches = run.time.searchsorted(max(times))
        with _browser(1280, 1560) as browser:
            browser.open(f"{page.as_uri()}#at={run.time[touches]}")
            browser.wait_for("document.documentElement.dataset.ready")
            browser.screenshot(folder / "report.png")


def draw_live(folder: Path) -> None:
    """live.png: the live page of a grasp after a change, never twice the same."""
    halt, name = threading.Event(), "sensor_2.reflectance"

    def look(address: str) -> None:
        try:
            with _browser(1400, 1300) as browser:
                browser.open(address)
                browser.wait_for("document.documentElement.dataset.ready && recording.last > 5")
                browser.evaluate(
                    "(() => { const find = document.getElementById('find-parameter');"
                    "find.value = 'reflectance'; find.dispatchEvent(new Event('input')); })()"
                )
                browser.evaluate(f"parameters.get('{name}').ask(0.7)")
                browser.wait_for("recording.last > 7")
                browser.evaluate("find('traces').scrollIntoView({ block: 'end' })")
                browser.evaluate("scrollTo({ top: 300, behavior: 'instant' })")
                browser.screenshot(folder / "live.png")
        finally:
            halt.set()

    with LivePage(grasp_system().natively()) as page, ThreadPoolExecutor(1) as pool:
        looking = pool.submit(look, page.address)
        simulate(
            page.system, step=1e-3, stop=600.0, realtime=True, listeners=[page.feed],
            requests=page.requests, halt=halt,
        )  # fmt: skip
        looking.result()


def draw_timing(folder: Path) -> None:
    """timing.png: how a run of this machine kept to the clock, never twice the same."""
    with TemporaryDirectory() as kept:
        tutorials.done("run", "--realtime", "--step", "1e-3", "--plot", "--out", kept)
        shutil.copy(Path(kept, "timing.png"), folder)


def draw_evaluation(folder: Path) -> None:
    """contact_times.png and contact_forces.png, which are in the page of `evaluate`."""
    evidence = reproduce(grasp_system(), "simulation", os.cpu_count() or 1, progress=False)
    for name, (title, figure) in figures(evidence, "simulation").items():
        if not name.startswith("target_position"):
            add_heading(
                figure, Caption(f"Published simulation, GraspController: {title}", about({}))
            )
            save_figure(figure, folder / f"{name}.png")


def draw_sweep_of_widths(folder: Path) -> None:
    """sweep.png: the first example of docs/how_to/sweep.md."""
    with TemporaryDirectory() as name:
        rows = ("--vary", "plant.object_width=0.04:0.08:100", "--step", "1e-3", "--plot")
        tutorials.done("sweep", *rows, "--out", str(Path(name, "sweep.csv")))
        shutil.copyfile(Path(name, "sweep.png"), folder / "sweep.png")


def draw_map(folder: Path) -> None:
    """The first example of docs/how_to/sweep.md."""
    page = (HERE / "how_to/sweep.md").read_text("utf-8")
    example = re.findall(r"```python\n(.*?)```", page, re.DOTALL)[1]
    exec(example.replace('"map.png"', repr(str(folder / "reflectance_map.png"))), {})  # noqa: S102


def draw_layer_2(folder: Path) -> None:
    """layer_2_loop.png: the example of docs/how_to/linear_analysis.md as a Bode plot."""
    page = (HERE / "how_to/linear_analysis.md").read_text("utf-8")
    names: dict[str, Any] = {}
    exec(re.findall(r"```python\n(.*?)```", page, re.DOTALL)[0], names)  # noqa: S102
    omega = np.geomspace(1.0, 3e3, 600)
    figure = new_figure(7.0, 4.6)
    gain, phase = figure.subplots(2, 1, sharex=True)
    for at, model in names["models"].items():
        loop, gap = -model.frequency_response(omega)[:, 0, 0], model.margins()
        (line,) = gain.loglog(omega, abs(loop), label=f"{at:g} s")
        phase.semilogx(omega, np.degrees(np.unwrap(np.angle(loop))), color=line.get_color())
        lag = gap.phase_margin - 180.0
        phase.plot([gap.crossover] * 2, [-180.0, lag], color=line.get_color(), lw=2.5, alpha=0.5)
    gain.axhline(1.0, color="0.6", lw=0.8)
    phase.axhline(-180.0, color="0.6", lw=0.8)
    gain.set(ylabel="|L|", ylim=(1e-3, 50.0))
    gain.legend(title="at", fontsize=8)
    phase.set(ylabel="phase of -L, \N{DEGREE SIGN}", xlabel="frequency, rad/s")
    phase.set(ylim=(-250.0, 160.0), yticks=[-180, -90, 0, 90])
    add_heading(
        figure, Caption("Layer 2 on the way to the surface", about({})), "bars: phase margins"
    )
    save_figure(figure, folder / "layer_2_loop.png")


PICTURES: Mapping[str, tuple[Callable[[Path], None], Sequence[str]]] = {
    "hand": (draw_hand, ["hand.svg"]),
    "first": (draw_first, ["first_grasp.png", "first_grasp_case_1.png"]),
    "three": (draw_three, ["three_fingers.svg", "three_fingers.png"]),
    "tandem": (draw_tandem, ["tandem.svg"]),
    "loop": (draw_loop, ["loop.svg"]),
    "three_layers": (draw_three_layers, ["three_layers.svg"]),
    "evaluation": (draw_evaluation, ["contact_times.png", "contact_forces.png"]),
    "report": (draw_report, ["report.png"]),
    "live": (draw_live, ["live.png"]),
    "timing": (draw_timing, ["timing.png"]),
    "calibration": (calibration_picture.draw, ["calibration.png"]),
    "sweep": (draw_sweep_of_widths, ["sweep.png"]),
    "maps": (draw_map, ["reflectance_map.png"]),
    "layer_2": (draw_layer_2, ["layer_2_loop.png"]),
    "delicate": (delicate_picture.draw, ["delicate.png"]),
    "method": (partial(tutorials.update, "explanation/method"), ["layers.png", "objects.png"]),
    "adaptive_law": (
        partial(tutorials.update, "explanation/adaptive_law"),
        ["unequal_faces.png", "colour.png"],
    ),
    "limits": (partial(tutorials.update, "explanation/limits"), ["limits.png"]),
    "your_plant": (partial(tutorials.update, "how_to/python_block"), ["your_plant.png"]),
}
"""What draws into a folder, and the files there."""


def main(*names: str) -> None:
    """Make the pictures of these names, or all."""
    if wrong := [name for name in names if name not in PICTURES]:
        raise SystemExit(f"{', '.join(wrong)}: must be of {', '.join(PICTURES)}")
    os.environ["SOURCE_DATE_EPOCH"] = tutorials.DATE
    for draw, _ in (PICTURES[name] for name in names or PICTURES):
        draw(HERE)


if __name__ == "__main__":
    main(*sys.argv[1:])
