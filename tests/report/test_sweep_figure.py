"""Pictures of studies: maps of grids and of points, distributions, and runs that have no value."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, System
from grasp_cosim.report.sweep import _cells, draw_sweep
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform, spaced
from grasp_cosim.sweep.run import Outcome
from grasp_cosim.sweep.study import Map, Parameter, Pictures, Study
from grasp_cosim.sweep.sweep import Sweep
from matplotlib.figure import Figure

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
    paths = draw_sweep([sweep], folder)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
    assert sorted(paths) == sorted(folder.iterdir())
    return [path.name for path in paths]


@pytest.mark.parametrize("design", [GRID, POINTS])
@pytest.mark.parametrize("failed", [(), (0, 7), tuple(range(20))])
def test_a_map_comes_out_whatever_was_found(
    grasp: System, design: Design, failed: tuple[int, ...], tmp_path: Path
) -> None:
    assert drawn(made(grasp, design, Pictures((MAP,)), *failed), tmp_path) == ["map.png"]


def test_distributions_have_axes_each(grasp: System, tmp_path: Path) -> None:
    pictures = Pictures((), ("time_difference", "impact_velocity[1]", "position"))
    assert drawn(made(grasp, POINTS, pictures, 3), tmp_path) == ["distributions.png"]


def test_nothing_asked_for_is_nothing_drawn(grasp: System, tmp_path: Path) -> None:
    assert drawn(made(grasp, GRID, Pictures()), tmp_path) == []


def test_what_is_not_there_is_said(grasp: System, tmp_path: Path) -> None:
    """Before the runs, not after hours of them."""
    for pictures, message in (
        (
            Pictures((Map("ratio", "position", "tilt"),)),
            "no column 'tilt' .* valid: ratio, position, t",
        ),
        (Pictures((), ("error",)), "no column 'error' in the results"),
        (Pictures((), ("time_to_contact",)), "no column 'time_to_contact' in the results"),
        (Pictures((Map("ratio", "ratio", "time_difference"),)), "x = y = 'ratio'; must be two"),
    ):
        with pytest.raises(InputError, match=message):
            made(grasp, GRID, pictures)


def test_variants_and_maps_are_beside_each_other(
    grasp: System, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr("grasp_cosim.report.sweep.save", lambda figure, _: figures.append(figure))
    pictures = Pictures((MAP, replace(MAP, of="impact_velocity[1]")), ("time_difference",))
    first, second = (made(grasp, GRID, pictures, *failed) for failed in ((), range(20)))
    named = [
        replace(sweep, study=replace(sweep.study, variant=name))
        for sweep, name in ((first, "a"), (second, "b"))
    ]
    draw_sweep(named, Path())
    maps, distributions = figures
    panels = [axes for axes in maps.axes if axes.get_label() != "<colorbar>"]
    assert [axes.get_title() for axes in panels] == ["a", "b", "", ""]
    scales = [axes.collections[0].get_clim() for axes in panels]
    assert scales[0] == scales[1] != scales[2] == scales[3]
    (legend,) = maps.legends
    assert [t.get_text() for t in legend.get_texts()] == [
        "time difference = 0.1 s", "no time difference", "no impact velocity, finger 1",
    ]  # fmt: skip
    assert [axes.get_title() for axes in distributions.axes] == ["a", "b"]


def test_a_cell_shows_the_mean_or_the_greatest_of_its_runs() -> None:
    x, y = np.array([1.0, 1.0, 1.0, 2.0, 2.0]), np.zeros(5)
    z = np.array([1.0, 3.0, np.nan, 2.0, 5.0])
    for cell, expected in (("mean", [2.0, 3.5]), ("greatest", [None, 5.0])):
        across, along, shown = _cells(Map("x", "y", "z", None, cell), x, y, z)  # type: ignore[arg-type]
        assert (across.tolist(), along.tolist()) == ([1.0, 2.0], [0.0])
        assert shown[0].tolist() == expected


ONE = 0.03
NEARLY = ONE * (1.0 + 2e-16)


@pytest.mark.parametrize(
    ("design", "values"),
    [
        (GRID, (ONE, NEARLY)),
        (GRID, (math.inf, 1.0)),
        (POINTS, (0.0,)),
        (POINTS, (math.nan, -math.inf)),
    ],
)
def test_a_metric_that_is_one_value_or_none_is_drawn(
    grasp: System, design: Design, values: tuple[float, ...], tmp_path: Path
) -> None:
    metric = "time_difference"
    sweep = made(grasp, design, Pictures((MAP,), (metric,)))
    outcomes = tuple(Outcome(k, {metric: values[k % len(values)]}) for k in range(20))
    both = ["map.png", "distributions.png"]
    assert drawn(replace(sweep, outcomes=outcomes), tmp_path) == both


def test_one_run_is_drawn(grasp: System, tmp_path: Path) -> None:
    sweep = made(grasp, Design("random", 1, 1), Pictures((MAP,), ("time_difference",)))
    only = replace(sweep, outcomes=sweep.outcomes[3:4])
    assert drawn(replace(only, outcomes=(replace(only.outcomes[0], index=0),)), tmp_path) == [
        "map.png", "distributions.png",
    ]  # fmt: skip


def test_any_name_is_drawn(grasp: System, tmp_path: Path) -> None:
    names = ("$\\alpha_1$ / 50 % & <b>", "位置/x y")
    study = made(grasp, GRID, Pictures()).study
    parameters = tuple(
        replace(p, name=name) for p, name in zip(study.parameters, names, strict=True)
    )
    pictures = Pictures((Map(*names, "time_difference", 0.1),), names)
    named = replace(study, name="a$b$_{.toml", parameters=parameters, pictures=pictures)
    sweep = replace(made(grasp, GRID, Pictures()), study=named)
    assert drawn(sweep, tmp_path) == ["map.png", "distributions.png"]


@pytest.mark.parametrize(("limit", "lines"), [(0.1, ["time difference = 0.1 s"]), (1e6, [])])
def test_a_limit_is_named_where_a_line_is_drawn(
    grasp: System, monkeypatch: pytest.MonkeyPatch, limit: float, lines: list[str]
) -> None:
    figures: list[Figure] = []
    monkeypatch.setattr("grasp_cosim.report.sweep.save", lambda figure, _: figures.append(figure))
    draw_sweep([made(grasp, GRID, Pictures((replace(MAP, limit=limit),)))], Path())
    legend = figures[0].axes[0].get_legend()
    assert ([text.get_text() for text in legend.get_texts()] if legend else []) == lines
