"""The command sweep: its summary, and one line per mistake."""

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest
from grasp_cosim import InputError, System, cli
from grasp_cosim.grasp.controllers import with_controller
from grasp_cosim.grasp.presets import STUDIES, with_preset
from grasp_cosim.sweep.read import Made, read_studies, study_file

Run = Callable[..., tuple[int, str, str]]

HEAD = "case = 0\nstep = 1e-3\nstop = 0.02\n"
GRID = '[design]\nkind = "grid"\n'
WIDTH = '[[parameters]]\nname = "width"\nvariables = ["plant.object_width"]\n'
MASS = '[[parameters]]\nvariables = ["plant.finger_mass[1]"]\nvalues = [0.5, 0.6]\n'
VALUES = "values = [0.06, 0.07]\n"
MAP = '[figures]\nmap = { x = "width", y = "plant.finger_mass[1]", of = "target_position" }\n'
STUDY = f'{HEAD}{GRID}{WIDTH}{VALUES}{MASS}{MAP}distributions = ["target_position"]\n'


@pytest.fixture
def command(command: Run, tmp_path: Path) -> Run:
    """Runs `sweep` in an empty folder, of a study of that text; exit code, output, errors."""

    def run(text: str, *arguments: str) -> tuple[int, str, str]:
        (tmp_path / "study.toml").write_text(text)
        return command("sweep", "study.toml", *arguments)

    return run


@pytest.mark.slow
def test_a_study_leaves_its_runs_and_pictures(command: Run, tmp_path: Path) -> None:
    code, out, err = command(STUDY, "--workers", "1", "--plot", "--json")
    summary = json.loads(out)
    assert code == 0
    assert (summary["study"], summary["design"]) == ("study.toml", "grid")
    assert (summary["runs"], summary["resumed"], summary["failed"]) == (4, 0, 0)
    assert summary["metrics"]["target_position"]["runs"] == 4
    assert summary["metrics"]["time_difference"]["runs"] == 0
    assert sorted(p.name for p in (tmp_path / "study").iterdir()) == [
        "distributions.png", "lock", "map.png", "parts", "runs.parquet", "study.json",
    ]  # fmt: skip
    assert "drew study/map.png" in err
    code, out, _ = command(STUDY, "--workers", "1")
    assert code == 0
    assert "study.toml: 4 runs, 4 of them done before, 0 failed; in study/runs.parquet" in out
    assert "width: 60 to 70 mm, 2 values" in out.splitlines()
    greatest = 1e3 * summary["metrics"]["target_position"]["greatest"]
    assert re.search(rf"^target_position +mm +4 .* {greatest:.4g} +\S+$", out, re.MULTILINE)
    code, out, err = command(STUDY.replace("0.06, ", "0.065, "), "--json")
    assert (code, out) == (2, "")
    assert err.splitlines() == [
        "grasp-cosim: study: has the runs of another study; --out must be another folder, or empty"
    ]


@pytest.mark.slow
def test_what_is_true_or_false_counts_as_1_or_0(command: Run, fmus: Path) -> None:
    """A cup that takes damage from the impact, and one that takes a hundred times as much."""
    swap = f"[swap]\nplant = '{fmus / 'GripperPlantCompliant.fmu'}'\n"
    limit = '[[parameters]]\nvariables = ["plant.squeeze_limit"]\nvalues = [0.001, 0.1]\n'
    text = f"{HEAD}{GRID}{swap}{limit}".replace("stop = 0.02", "stop = 0.2")
    code, out, _ = command(text, "--workers", "1", "--json")
    assert code == 0
    metrics = json.loads(out)["metrics"]
    assert metrics["damaged"] == {
        "runs": 2, "least": 0.0, "p5": 0.05, "median": 0.5, "p95": 0.95, "greatest": 1.0,
        "mean": 0.5,
    }  # fmt: skip
    assert 0.001 < metrics["squeeze"]["least"] == metrics["squeeze"]["greatest"] < 0.1
    assert metrics["settling_time[1]"]["runs"] == 0
    assert pq.read_table("study/runs.parquet")["damaged"].to_pylist() == [True, False]


@pytest.mark.slow
def test_where_every_run_fails_the_result_is_negative(command: Run) -> None:
    narrow = STUDY.replace("values = [0.06, 0.07]", "values = [0.06]").replace(
        "[0.5, 0.6]", "[0.5]"
    )
    text = narrow.replace("case = 0\n", 'case = 0\noutputs = ["plant.gap[1]"]\n')
    position = '[[parameters]]\nvariables = ["plant.initial_object_position"]\nvalues = [0.2]\n'
    text = text.replace("[figures]", f"{position}[figures]")
    code, out, _ = command(text, "--workers", "1", "--plot")
    assert code == 1
    assert re.search(r"1 runs, 0 of them done before, 1 failed", out)
    assert sorted(p.name for p in Path("study").glob("*.png")) == ["distributions.png", "map.png"]
    assert re.search(r"^the first that failed, 0: plant: ", out, re.MULTILINE)


WRONG = [
    ("[design", "study.toml: not readable as TOML"),
    ("colour = 1\n", "study.toml: unknown entry 'colour'; valid: bench, case, controller, design"),
    (HEAD, r"study.toml: \[design\]: missing; must be a table"),
    (f"{HEAD}[design]\n", "no kind; must have one"),
    (f"{HEAD}{GRID}count = 3\n", "unknown entry 'count'; valid: kind, runs, seed"),
    (f"{HEAD}{GRID}", r"no \[\[parameters\]\]; must be at least one"),
    (f"{HEAD}{GRID}{WIDTH}", "no values; must have exactly one of values, linspace, geomspace"),
    (f"{HEAD}{GRID}{WIDTH}{VALUES}uniform = 3\n", "values and uniform; must have exactly one"),
    (f"{HEAD}{GRID}{WIDTH}values = 3\n", "values = 3: must be a list of values"),
    (f"{HEAD}{GRID}{WIDTH}values = [[3]]\n", r"values = \[3\]: must be a number, boolean or"),
    (
        f"{HEAD}{GRID}{WIDTH}uniform = {{ low = 0.05, high = 0.07 }}\n",
        "study.toml: design: parameter 1 has",
    ),
    (f"{HEAD}{GRID}{WIDTH}uniform = {{ low = 0.07, high = 0.05 }}\n", "must have low below high"),
    (f"{HEAD}{GRID}{WIDTH}uniform = {{ low = 0.07 }}\n", "high = None: must be a finite number"),
    (f"{HEAD}{GRID}{WIDTH}linspace = {{ from = 0.05, to = 0.07, count = 1.5 }}\n", "count = 1.5"),
    (f"{HEAD}{GRID}{WIDTH}geomspace = {{ from = 0, to = 0.07, count = 2 }}\n", "greater than 0"),
    (
        f"{HEAD}{GRID}{WIDTH}normal = {{ mean = 3, standard_deviation = 1, low = 0, high = 1 }}\n",
        "mean = 3.0: must be from low, 0.0, to high, 1.0",
    ),
    *(
        (
            f"{HEAD}{GRID}{WIDTH}normal = {{ mean = {mean}, standard_deviation = 1, low = 0, "
            "high = 1 }\n",
            f"normal: mean = {shown}: must be a finite number",
        )
        for mean, shown in (('"x"', "'x'"), ("true", "True"))
    ),
    (
        f"{HEAD}{GRID}{WIDTH}normal = {{ mean = 0, standard_deviation = 0, low = 0, high = 1 }}\n",
        "standard_deviation = 0.0: must be greater than 0",
    ),
    (f'{HEAD}[design]\nkind = "random"\n{WIDTH}{VALUES}', "no seed; must be a whole number"),
    (f'{HEAD}[design]\nkind = "sobol"\nseed = 1\nruns = 3\n{WIDTH}{VALUES}', "a power of two"),
    (f"seeds = 3\n{HEAD}{GRID}{WIDTH}{VALUES}", "seeds = 3: must be a list of names"),
    (f"system = 3\n{HEAD}{GRID}{WIDTH}{VALUES}", "system = 3: must be the path"),
    (f'system = "no.toml"\n{HEAD}{GRID}{WIDTH}{VALUES}', "no.toml: no such system file"),
    (
        f"{GRID}{WIDTH}{VALUES}".replace("[des", "case = 3\n[des"),
        "case = 3: .*no preset 'case_3'; did you mean case_0, case_1, case_2",
    ),
    (f"step = 0\n{GRID}{WIDTH}{VALUES}", "study.toml: step = 0 s: must be a number greater than"),
    (f"{HEAD}{GRID}{WIDTH}{VALUES}[swap]\nplant = 3\n", "plant = 3: must be the path of an FMU"),
    (f'{HEAD}{GRID}{WIDTH}{VALUES}[swap]\nplant = "x.fmu"\n', "x.fmu: no such FMU file"),
    (f'{HEAD}{GRID}{WIDTH}{VALUES}[values]\n"plant.x" = 3\n', r"\[values\] plant.x: .*no input"),
    (
        f'{HEAD}{GRID}{WIDTH}{VALUES}[values]\n"plant.object_width" = 0.07\n',
        r"\[values\]: plant.object_width: is varied by",
    ),
    (f'{HEAD}{GRID}{WIDTH}{VALUES}[figures]\nmap = {{ x = "a" }}\n', "map: y = None: must be a"),
    ("[" * 10_000, "study.toml: not readable as TOML"),
    (f"stop = 1{'0' * 5000}\n", "study.toml: not readable as TOML: Exceeds the limit"),
    (f"bench = 1\n{HEAD}{GRID}{WIDTH}{VALUES}", "bench = 1: must be true or false"),
    (f'{HEAD}{GRID}{WIDTH}{VALUES}name = "a\\nb"\n'.replace('name = "width"\n', ""), "of one line"),
    (f"{HEAD}{GRID}{WIDTH}linspace = {{ from = 1{'0' * 400}, to = 1, count = 2 }}\n", "finite num"),
    (f"{HEAD}{GRID}{WIDTH}uniform = {{ low = -1e308, high = 1e308 }}\n", "nearer to each other"),
    (f"{HEAD}{GRID}{WIDTH}linspace = {{ from = -1e308, to = 1e308, count = 2 }}\n", "nearer to"),
    (
        f"{GRID}{WIDTH}normal = {{ mean = 1, standard_deviation = 9e9, low = 0, high = 2 }}\n",
        "standard_deviation = 9000000000.0: must be at most 1e\\+06 times high - low, or the form",
    ),
    (
        f'seeds = ["sensor_1.noise.seed"]\n{HEAD}{GRID}seed = 1\n{WIDTH}{VALUES}[values]\n'
        '"sensor_1.noise.seed" = 3\n',
        "sensor_1.noise.seed: is varied by",
    ),
    (f"{STUDY}".replace('["target_position"]', '["tilt"]'), "figures: no column 'tilt' in the res"),
]


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_wrong_input_is_one_line_and_exit_2(
    command: Run, tmp_path: Path, text: str, message: str
) -> None:
    code, out, err = command(text, "--json")
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("grasp-cosim: ")
    assert re.search(message, err), err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["study.toml"]


FIGURES = [
    (
        "distribution = []\n",
        r"\[figures\]: unknown entry 'distribution'; did you mean distributions",
    ),
    ('curve = { x = "width" }\n', "curve: of = None: must be a name"),
    ('curve = { x = "width", of = "tilt" }\n', "figures: no column 'tilt' in the results; valid: "),
    (
        'curve = { x = "wide", of = "tilt" }\n',
        "figures.curve: no parameter 'wide' with numbers; did you mean width",
    ),
    (
        'curve = [{ x = "width", of = "tilt", y = "x" }]\n',
        "unknown entry 'y'; valid: cell, limit, o",
    ),
    ('curve = { x = "width", of = "object_shift", cell = "most" }\n', "cell = 'most': must be one"),
]


@pytest.mark.parametrize(("text", "message"), FIGURES)
def test_wrong_figures_are_one_line(command: Run, text: str, message: str) -> None:
    code, out, err = command(f"{HEAD}{GRID}{WIDTH}{VALUES}[figures]\n{text}")
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert re.search(message, err), err


@pytest.mark.usefixtures("command")
def test_no_such_study_names_the_built_in_ones(capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.main(["sweep", "map"])
    assert code == 2
    assert capsys.readouterr().err == (
        "grasp-cosim: map: no such study, nor .toml file; did you mean colour_map, "
        "colour_map_free, reflectance_map?\n"
    )


def test_a_plot_of_nothing_is_refused_before_the_runs(command: Run, tmp_path: Path) -> None:
    code, _, err = command(f"{HEAD}{GRID}{WIDTH}{VALUES}", "--plot")
    assert (code, err.count("\n")) == (2, 1)
    assert "--plot: study.toml has no [figures]; must say what to draw" in err
    assert not (tmp_path / "study").exists()


def test_a_cluster_has_its_own_workers(command: Run) -> None:
    code, _, err = command(STUDY, "--workers", "2", "--scheduler", "tcp://127.0.0.1:1")
    assert code == 2
    assert "--workers: must not come with --scheduler" in err


def test_no_pyarrow_is_one_line(command: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    code, _, err = command(STUDY)
    assert code == 2
    assert err.endswith("-m pip install 'pyarrow>=26' 'scipy>=1.15'\n")


def test_a_study_of_the_bench_is_that_of_run_bench(tmp_path: Path, grasp: System) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        f"bench = true\n{STUDY}".replace(
            "[figures]", '[values]\n"sensor_1.adc.bits" = 12\n[figures]'
        )
    )
    (study,) = read_studies(path, Made(lambda _: grasp, with_preset))
    off = {"controller.simultaneous_contact.enabled": False, "sensor_1.adc.bits": 12}
    off |= {"controller.impact_reduction.enabled": False}
    expected = with_preset(grasp, "bench").with_values(off).with_experiment(step=1e-3, stop=0.02)
    assert study.system.components == expected.components


def test_a_bench_that_does_not_fit_is_one_line(tmp_path: Path, grasp: System) -> None:
    path = tmp_path / "study.toml"
    path.write_text(f"bench = true\n{STUDY}")
    plant = replace(grasp.components[0], values={"force[1]": 0.0, "force[2]": 0.0})
    bare = replace(grasp, components=(plant,), connections=())
    place = r"grasp.toml: \[presets.bench\] sensor_1"
    with pytest.raises(InputError, match=rf"^study.toml: bench = true: {place}.*: no component"):
        read_studies(path, Made(lambda _: bare, with_preset))


@pytest.mark.parametrize("name", sorted(p.stem for p in STUDIES.glob("*.toml")))
def test_a_built_in_study_fits_the_grasp(name: str, grasp: System, fmus: Path) -> None:
    made = Made(lambda _: grasp, with_preset, with_controller, fmus)
    for study in read_studies(study_file(name, STUDIES), made):
        assert study.runs >= 50
        for index in (0, study.runs - 1):
            study.system.with_values(study.values(index))


@pytest.mark.slow
def test_a_limit_that_is_missed_is_a_negative_result(command: Run) -> None:
    """The target is at 0 m at first in every run, and an object that is not touched is at rest."""
    limits = "[limits]\nobject_shift = { greatest = 0.0 }\ntarget_position = { p95 = MOST }\n"
    text = STUDY.replace("[figures]", limits + "[figures]")
    code, out, _ = command(text.replace("MOST", "0.1"), "--workers", "1")
    assert code == 0
    assert "kept    object_shift: greatest 0 mm, at most 0 mm" in out.splitlines()
    code, out, _ = command(text.replace("MOST", "-0.1"), "--workers", "1", "--json")
    kept, missed = json.loads(out)["limits"]
    assert (code, kept["kept"], missed["kept"], missed["missing"]) == (1, True, False, 0)
    timed = text.replace("target_position = { p95 = MOST }", "time_difference = { p95 = 9.0 }")
    code, out, _ = command(timed, "--workers", "1")
    assert code == 1
    assert "MISSED  time_difference: p95 none, at most 9 s; 4 runs have none" in out.splitlines()


@pytest.mark.slow
def test_variants_are_runs_in_folders_of_their_names(command: Run, tmp_path: Path) -> None:
    variants = (
        '[[variants]]\nname = "light"\n'
        '[[variants]]\nname = "heavy"\nvalues = { "plant.finger_mass[2]" = 5.0 }\n'
        'limits = { target_position = { greatest = 1e-2, from = "light" } }\n'
    )
    text = STUDY.replace("[figures]", f"{variants}[figures]")
    code, out, err = command(text, "--workers", "1", "--plot")
    assert code == 0, out + err
    assert "drew study/map.png" in err
    assert sorted(p.name for p in (tmp_path / "study").iterdir()) == [
        "distributions.png", "heavy", "light", "map.png",
    ]  # fmt: skip
    assert re.search(
        r"^target_position +light +mm +4 .*\ntarget_position +heavy +mm +4 ", out, re.M
    )
    assert re.search(
        r"^kept    heavy: target_position from light: greatest \S+ mm, at most 10 mm$", out, re.M
    )
    code, out, _ = command(text, "--workers", "1", "--json")
    found = json.loads(out)
    assert {n: v["resumed"] for n, v in found["variants"].items()} == {"light": 4, "heavy": 4}


@pytest.mark.slow
def test_another_seed_draws_other_runs_beside_the_first(command: Run, tmp_path: Path) -> None:
    text = STUDY.replace(GRID, '[design]\nkind = "random"\nruns = 2\nseed = 1\n')
    for arguments in ((), ("--seed", "1"), ("--seed", "2")):
        assert command(text, "--workers", "1", *arguments)[0] == 0
    first, same, other = (
        pq.read_table(tmp_path / name / "runs.parquet") for name in ("study", "study-1", "study-2")
    )
    assert first == same
    assert first["plant.finger_mass[1]"] != other["plant.finger_mass[1]"] or (
        first["width"] != other["width"]
    )


def test_what_is_not_drawn_has_no_seed(command: Run) -> None:
    code, _, err = command(STUDY, "--seed", "3")
    assert (code, err.count("\n")) == (2, 1)
    assert "--seed 3: study.toml has nothing that is random; must be left out" in err


def test_a_controller_that_the_study_swaps_takes_no_other(command: Run) -> None:
    swap = 'swap = { controller = "mine.fmu" }\n'
    code, _, err = command(f"{swap}{STUDY}", "--controller", "adaptive")
    assert (code, err.splitlines()) == (
        2,
        [
            "grasp-cosim: study.toml: controller adaptive: cannot be used with another FMU for "
            "controller"
        ],
    )


def test_a_study_that_names_its_controller_takes_no_other(command: Run) -> None:
    code, _, err = command(f'controller = "adaptive"\n{STUDY}', "--controller", "published")
    assert (code, err.splitlines()) == (
        2,
        [
            "grasp-cosim: study.toml: --controller published: must be left out, the study names "
            "'adaptive'"
        ],
    )
