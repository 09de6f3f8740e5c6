"""The sweeps of docs/colour.md: `python docs/colour_studies.py map` draws colour_map.png, and
`... monte_carlo` prints its table. Two minutes each on one processor.
"""

import sys
from pathlib import Path

import numpy as np
from grasp_cosim import System, grasp_system, sweep
from grasp_cosim.grasp.presets import with_preset
from grasp_cosim.report.plot import new_figure, save
from grasp_cosim.sweeps.rows import grid
from scipy.stats import qmc

HERE = Path(__file__).parent
LAWS = ("published", "adaptive")
Spans = dict[tuple[str, ...], tuple[float, float]]
SMOOTH = {f"plant.friction.{kind}[{j}]": 0.0 for kind in ("coulomb", "viscous") for j in (1, 2)}
"""Fingers without friction: the sensors of the bench alone."""


def rig(law: str, bench: bool) -> System:
    """The grasp under a law, with ideal sensors or those of the bench; steps of 1 ms."""
    system = grasp_system(law).with_experiment(step=1e-3, stop=6.0)
    return with_preset(system, "bench") if bench else system


def draw_map(path: Path) -> None:
    """Time differences in s over both reflectances, a cell the worst of six positions."""
    faces, positions = np.geomspace(0.3, 1.2, 9), np.linspace(0.0, 0.05, 6)
    names = ("sensor_1.reflectance", "sensor_2.reflectance", "plant.initial_object_position")
    rows = grid(dict(zip(names, (faces, faces, positions), strict=True)))
    figure = new_figure(8.0, 6.6)
    panels = figure.subplots(2, 2, sharex=True, sharey=True)
    for bench, along in zip((False, True), panels, strict=True):
        for law, axes in zip(LAWS, along, strict=True):
            system = rig(law, bench).with_values(SMOOTH if bench else {})
            worst = sweep(system, rows)["time_difference"].reshape(9, 9, 6).max(axis=2)
            cells = axes.pcolormesh(faces, faces, worst.T, vmin=0.0, vmax=1.0)
            axes.set_facecolor("#dddddd")  # of cells where a finger never touched
            axes.set_title(f"{law}, {'bench' if bench else 'ideal'} sensors", fontsize=10)
    for axes in panels[1]:
        axes.set_xlabel("right reflectance")
    for axes in panels[:, 0]:
        axes.set_ylabel("left reflectance")
    figure.colorbar(cells, ax=panels, label="time difference in s, the worst of six positions")
    save(figure, path)


def spans() -> Spans:
    """What the Monte Carlo draws, from where to where, SI units; several places get one value."""
    pair = {
        "reflectance": (0.3, 1.2),
        "ambient.calibration_error": (-1e-3, 1e-3),
        "ambient.drift": (-5e-3, 5e-3),
        "pattern.phase": (0.0, 2e-2),
    }
    each: Spans = {(f"sensor_{j}.{name}",): span for name, span in pair.items() for j in (1, 2)}
    both = {"pattern.ratio": (0.9, 1.0), "pattern.period": (4e-3, 2e-2)}
    shared: Spans = {tuple(f"sensor_{j}.{n}" for j in (1, 2)): span for n, span in both.items()}
    friction = {"coulomb": (0.0, 1.0), "viscous": (0.0, 10.0)}
    fingers: Spans = {
        tuple(f"plant.friction.{kind}[{j}]" for j in (1, 2)): span
        for kind, span in friction.items()
    }
    free: Spans = {
        ("plant.initial_object_position",): (-0.05, 0.05),
        ("plant.object_mass",): (0.02, 0.05),
    }
    return {**free, **each, **shared, **fingers}


def drawn(runs: int, seed: int = 20241107) -> list[dict[str, float]]:
    """Rows of a Latin hypercube; n and l_0 of the left sensor are near those of the right one."""
    varied = spans()
    rng = np.random.default_rng(seed)
    cube = qmc.LatinHypercube(len(varied) + 4, rng=rng).random(runs)
    rows = []
    for k, point in enumerate(cube):
        row = {
            place: low + u * (high - low)
            for (places, (low, high)), u in zip(varied.items(), point, strict=False)
            for place in places
        }
        n, ratio, l_0, other = point[-4:]
        row["sensor_1.diffusion_exponent"] = 1.0 + 0.3 * n
        row["sensor_2.diffusion_exponent"] = (1.0 + 0.3 * n) * (0.995 + 0.01 * ratio)
        row["sensor_1.offset_distance"] = 4.5e-3 + 1e-3 * l_0
        row["sensor_2.offset_distance"] = (4.5e-3 + 1e-3 * l_0) * (0.98 + 0.04 * other)
        row |= {"sensor_1.noise.seed": 2 * k + 1, "sensor_2.noise.seed": 2 * k + 2}
        rows.append(row)
    return rows


def spread(values: np.ndarray) -> np.ndarray:
    """The median, 95 % and the greatest of the values that there are."""
    return np.array(np.nanpercentile(values, (50, 95, 100)))


def monte_carlo(runs: int) -> str:
    """Median, 95 % and greatest of three metrics under both laws, as a table of Markdown."""
    shown = {"time_difference": (1.0, 3), "force_difference": (1.0, 3), "object_shift": (1e3, 2)}
    stripes = {f"sensor_{j}.pattern.enabled": True for j in (1, 2)}
    lines = ["| law | apart, s | force difference, N | object shifted, mm |", "|---|---|---|---|"]
    for law in LAWS:
        system = rig(law, bench=True).with_experiment(stop=8.0).with_values(stripes)
        plant = system.component("plant", "plant").fmu.with_name("GripperPlantMovable.fmu")
        table = sweep(system.swap("plant", plant), drawn(runs))
        cells = [
            " / ".join(f"{factor * x:.{digits}f}" for x in spread(table[name]))
            for name, (factor, digits) in shown.items()
        ]
        lines.append(f"| {law} | {' | '.join(cells)} |")
    return "\n".join(lines)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["map"]:
            draw_map(HERE / "colour_map.png")
        case ["monte_carlo"]:
            print(monte_carlo(300))
        case _:
            sys.exit(__doc__)
