"""Pictures of studies: maps of grids and of points, distributions, and runs that have no value."""

from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.figures.sweep import draw_sweep
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform, spaced
from grasp_cosim.sweep.run import Outcome
from grasp_cosim.sweep.study import Map, Parameter, Pictures, Study
from grasp_cosim.sweep.sweep import Sweep

RATIO = Parameter(
    "ratio", ("sensor_1.reflectance",), spaced(0.5, 2.0, 5, True), "sensor_2.reflectance"
)
POSITION = Parameter("position", ("plant.initial_object_position",), Uniform(0.0, 0.04))
ROWS = Parameter("position", POSITION.variables, spaced(0.0, 0.04, 4, False))
MAP = Map("ratio", "position", "time_difference", 0.1)
GRID = Design("grid")
POINTS = Design("latin-hypercube", 20, 1)


def made(system: System, design: Design, pictures: Pictures, *failed: int) -> Sweep:
    """A sweep of 20 runs with times from 1 ms to 2 s; those that failed have an error."""
    position = ROWS if design is GRID else POSITION
    study = Study("made", system, (RATIO, position), design, pictures=pictures)
    outcomes = (
        Outcome(k, {}, "plant: failed")
        if k in failed
        else Outcome(k, {"time_difference": 1e-3 * 1.5**k, "impact_velocity[1]": 0.0 * k})
        for k in range(20)
    )
    return Sweep(study, Path("made"), tuple(outcomes), 0)


def drawn(sweep: Sweep, folder: Path) -> list[str]:
    paths = draw_sweep(sweep, folder)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
    assert sorted(paths) == sorted(folder.iterdir())
    return [path.name for path in paths]


@pytest.mark.parametrize("design", [GRID, POINTS])
@pytest.mark.parametrize("failed", [(), (0, 7), tuple(range(20))])
def test_a_map_comes_out_whatever_was_found(
    grasp: System, design: Design, failed: tuple[int, ...], tmp_path: Path
) -> None:
    first = () if len(failed) < 20 else (19,)  # at least one value: else there is no such column
    gone = [k for k in failed if k not in first]
    assert drawn(made(grasp, design, Pictures(MAP), *gone), tmp_path) == ["map.png"]


def test_distributions_have_axes_each(grasp: System, tmp_path: Path) -> None:
    pictures = Pictures(None, ("time_difference", "impact_velocity[1]", "position"))
    assert drawn(made(grasp, POINTS, pictures, 3), tmp_path) == ["distributions.png"]


def test_nothing_asked_for_is_nothing_drawn(grasp: System, tmp_path: Path) -> None:
    assert drawn(made(grasp, GRID, Pictures()), tmp_path) == []


def test_what_is_not_there_is_said(grasp: System, tmp_path: Path) -> None:
    pictures = Pictures(Map("ratio", "position", "tilt"))
    with pytest.raises(InputError, match=r"'tilt': no such column .* valid: ratio, position, time"):
        draw_sweep(made(grasp, GRID, pictures), tmp_path)
    with pytest.raises(InputError, match="'error': no run has a number there"):
        draw_sweep(made(grasp, GRID, Pictures(None, ("error",))), tmp_path)
