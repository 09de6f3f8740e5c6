"""Pictures of studies: maps of grids and of points, distributions, and runs that have no value."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, System
from grasp_cosim.report.sweep import _borders, _cells, draw_sweep
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Listed, Uniform, spaced
from grasp_cosim.sweep.run import Outcome
from grasp_cosim.sweep.study import Curve, Map, Parameter, Pictures, Study
from grasp_cosim.sweep.sweep import Sweep
from matplotlib.figure import Figure
from support.slow import slow

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


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """What is drawn, in place of files."""
    found: list[Figure] = []
    monkeypatch.setattr("grasp_cosim.report.sweep.save", lambda figure, _: found.append(figure))
    return found


def legend_of(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def drawn(sweep: Sweep, folder: Path) -> list[str]:
    paths = draw_sweep([sweep], folder)
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
    assert sorted(paths) == sorted(folder.iterdir())
    return [path.name for path in paths]


@pytest.mark.parametrize(
    ("design", "failed"),
    [
        slow(GRID, ()),
        (GRID, (0, 7)),
        slow(GRID, tuple(range(20))),
        slow(POINTS, ()),
        slow(POINTS, (0, 7)),
        (POINTS, tuple(range(20))),
    ],
)
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


def test_variants_and_maps_are_beside_each_other(grasp: System, figures: list[Figure]) -> None:
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
    assert legend_of(maps) == [
        "time difference = 0.1 s", "no time difference: 20 of 20 cells",
        "no impact velocity, finger 1: 20 of 20 cells",
    ]  # fmt: skip
    assert [axes.get_title() for axes in distributions.axes] == ["a", "b"]
    for figure in figures:
        title, about = (text.get_text() for text in figure.texts)
        assert title == "grasp: 2 times 20 runs, 20 failed, over ratio and position"
        assert about.startswith("as in the system file · ")


def test_it_says_what_differs_in_all_variants_and_takes_a_title(
    grasp: System, figures: list[Figure]
) -> None:
    """But not what varies anyway, here the reflectance."""
    width = {"plant.object_width": 0.06, "sensor_1.reflectance": 0.5}
    mass = {"plant.finger_mass[1]": 0.4}
    both = [
        made(grasp.with_values(values), GRID, Pictures((MAP,)))
        for values in (width | mass, width | {"plant.finger_mass[1]": 0.6})
    ]
    draw_sweep(both, Path(), title="Before $5 of _lunch_")
    title, about = (text.get_text() for text in figures[0].texts)
    assert title == "Before $5 of _lunch_"
    assert about.startswith("plant.object_width = 0.06 · ")


@pytest.mark.parametrize(
    ("suffix", "begin"), [slow("png", b"\x89PNG"), ("svg", b"<?xml"), slow("pdf", b"%PDF")]
)
def test_it_is_in_the_format_asked_for(
    grasp: System, tmp_path: Path, suffix: str, begin: bytes
) -> None:
    sweep = made(grasp, GRID, Pictures((MAP,), (), (Curve("position", "time_difference"),)), 4)
    for path in draw_sweep([sweep], tmp_path, suffix):
        assert path.read_bytes().startswith(begin)
    assert {p.name for p in tmp_path.iterdir()} == {f"map.{suffix}", f"curve.{suffix}"}


def test_a_cell_shows_the_mean_or_the_greatest_of_its_runs() -> None:
    x, y = np.array([1.0, 1.0, 1.0, 2.0, 2.0]), np.zeros(5)
    z = np.array([1.0, 3.0, np.nan, 2.0, 5.0])
    for cell, expected in (("mean", [2.0, 3.5]), ("greatest", [np.nan, 5.0])):
        across, along, shown = _cells(cell, x, y, z)  # type: ignore[arg-type]
        assert (across.tolist(), along.tolist()) == ([1.0, 2.0], [0.0])
        assert np.array_equal(shown, [expected], equal_nan=True)


ONE = 0.03
NEARLY = ONE * (1.0 + 2e-16)


@pytest.mark.parametrize(
    ("design", "values"),
    [
        (GRID, (ONE, NEARLY)),
        slow(GRID, (math.inf, 1.0)),
        slow(POINTS, (0.0,)),
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


@pytest.mark.slow
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
    grasp: System, figures: list[Figure], limit: float, lines: list[str]
) -> None:
    draw_sweep([made(grasp, GRID, Pictures((replace(MAP, limit=limit),)))], Path())
    assert legend_of(figures[0]) == lines


def test_cells_are_around_the_runs_and_end_half_a_cell_beyond() -> None:
    assert _borders(np.array([0.0, 10.0, 20.0]), False).tolist() == [-5.0, 5.0, 15.0, 25.0]
    ratio = _borders(np.array([0.5, 1.0, 2.0]), True)
    assert ratio == pytest.approx([0.5 / 2**0.5, 0.5 * 2**0.5, 2**0.5, 2.0 * 2**0.5])
    assert _borders(np.array([0.3, 0.5, 1.2]), False) == pytest.approx([0.2, 0.4, 0.85, 1.55])
    assert _borders(np.array([20.0]), False).tolist() == [19.0, 21.0]
    assert _borders(np.array([0.0]), False).tolist() == [-0.5, 0.5]


def test_nothing_is_painted_beyond_the_runs(grasp: System, figures: list[Figure]) -> None:
    """In mm; what is not there shows the hatches behind the cells, which the legend names."""
    draw_sweep([made(grasp, GRID, Pictures((MAP,)), 3, 7)], Path())
    axes, scale = figures[0].axes
    mesh = axes.collections[0]
    shown = mesh.get_array()
    assert shown is not None
    assert np.ma.getmaskarray(shown).ravel().nonzero()[0].tolist() == [
        15,
        16,
    ]  # (3, 0) and (3, 1)
    borders = mesh.get_coordinates()  # type: ignore[attr-defined]
    assert axes.get_ylim() == (borders[0, 0, 1], borders[-1, -1, 1])
    assert axes.get_xlim() == (borders[0, 0, 0], borders[-1, -1, 0])
    assert axes.get_ylim() == pytest.approx((-20.0 / 3.0, 40.0 + 20.0 / 3.0))
    assert axes.get_xlim() == pytest.approx((0.5 / 2**0.25, 2.0 * 2**0.25))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("ratio", "position in mm")
    assert axes.patch.get_hatch() == "////"
    assert scale.get_ylabel() == "time difference in s"
    assert legend_of(figures[0]) == [
        "time difference = 0.1 s", "no time difference: 2 of 20 cells"
    ]  # fmt: skip


@pytest.mark.parametrize(("values", "dots"), [((0.01, 0.02, 0.04, 0.05), 20), (None, 0)])
def test_runs_at_uneven_distances_are_marked(
    grasp: System, figures: list[Figure], values: tuple[float, ...] | None, dots: int
) -> None:
    sweep = made(grasp, GRID, Pictures((replace(MAP, limit=None),)))
    rows = replace(ROWS, distribution=Listed(values)) if values else ROWS
    study = replace(sweep.study, parameters=(RATIO, rows))
    draw_sweep([replace(sweep, study=study)], Path())
    axes = figures[0].axes[0]
    assert sum(np.size(line.get_xdata()) for line in axes.lines) == dots
    if values:
        assert axes.get_yticks() == pytest.approx([10.0, 20.0, 40.0, 50.0])


def test_a_scale_that_is_cut_off_says_so(grasp: System, figures: list[Figure]) -> None:
    sweep = made(grasp, GRID, Pictures((MAP,)))
    for least in (1e-9, 5e-3):
        times = [least, *(1e-2 * 1.3**k for k in range(19))]
        found = tuple(Outcome(k, {"time_difference": t}) for k, t in enumerate(times))
        draw_sweep([replace(sweep, outcomes=found)], Path())
    ends = [figure.axes[1]._colorbar.extend for figure in figures]  # type: ignore[attr-defined]
    assert ends == ["min", "neither"]


def test_a_curve_has_a_mark_for_each_run_and_names_what_is_missing(
    grasp: System, figures: list[Figure]
) -> None:
    """One line for each finger, told apart without colours, too; in mm/s."""
    study = Study(
        "made",
        grasp,
        (ROWS,),
        GRID,
        pictures=Pictures(curves=(Curve("position", "impact_velocity", 8e-3),)),
    )
    found = [
        Outcome(k, {"impact_velocity[1]": 1e-3 * k, "impact_velocity[2]": None if k == 2 else 2e-3})
        for k in range(4)
    ]
    draw_sweep([Sweep(study, Path("made"), tuple(found), 0)], Path())
    (axes,) = figures[0].axes
    first, second, missing, limit = axes.lines
    assert first.get_xdata() == pytest.approx([0.0, 40.0 / 3.0, 80.0 / 3.0, 40.0])
    assert first.get_ydata() == pytest.approx([0.0, 1.0, 2.0, 3.0])
    assert np.array_equal(np.isnan(second.get_ydata()), [False, False, True, False])
    assert missing.get_xdata() == pytest.approx([80.0 / 3.0])
    assert list(limit.get_ydata()) == [8.0, 8.0]  # type: ignore[arg-type]
    styles = {(line.get_linestyle(), line.get_marker()) for line in (first, second)}
    assert styles == {("-", "o"), ("--", "s")}
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "impact velocity, finger 1", "impact velocity, finger 2",
        "no impact velocity, finger 2: 1 of 4", "limit, 8 mm/s",
    ]  # fmt: skip
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("position in mm", "impact velocity in mm/s")


@pytest.mark.parametrize(("design", "style"), [(GRID, "-"), (POINTS, "None")])
def test_a_curve_over_one_of_several_is_the_mean_in_a_grid_else_points(
    grasp: System, figures: list[Figure], design: Design, style: str
) -> None:
    sweep = made(grasp, design, Pictures(curves=(Curve("position", "time_difference"),)))
    draw_sweep([sweep], Path())
    (line,) = figures[0].axes[0].lines
    assert line.get_linestyle() == style
    values = sweep.numbers("time_difference")
    expected = values.reshape(5, 4).mean(axis=0) if design is GRID else values
    assert line.get_ydata() == pytest.approx(expected)
    whose = "mean of " if design is GRID else ""
    assert figures[0].axes[0].get_ylabel() == f"{whose}time difference in s"
