"""The command sweep --vary: a study without a file."""

import json
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq  # type: ignore[import-untyped]
import pytest

Run = Callable[..., tuple[int, str, str]]

SHORT = ("--case", "0", "--step", "1e-3", "--stop", "0.02", "--workers", "1")
WIDTH = ("--vary", "plant.object_width=0.06:0.07:3")
MASS = ("--vary", "plant.finger_mass[1]=0.5,0.6")
FILE = """
case = 0
step = 1e-3
stop = 0.02
outputs = ["plant.gap[1]"]
[values]
"plant.finger_mass[2]" = 0.4
[design]
kind = "grid"
[[parameters]]
variables = ["plant.object_width"]
linspace = { from = 0.06, to = 0.07, count = 3 }
[[parameters]]
variables = ["plant.finger_mass[1]"]
values = [0.5, 0.6]
[figures]
map = { x = "plant.object_width", y = "plant.finger_mass[1]", of = "plant.gap[1]" }
"""


@pytest.mark.slow
def test_it_is_the_study_of_a_file_and_goes_on(command: Run, tmp_path: Path) -> None:
    """The same bits, on any number of workers; and the same folder, as it is the same study."""
    (tmp_path / "study.toml").write_text(FILE)
    assert command("sweep", "study.toml", "--workers", "1")[0] == 0
    values = ("--set", "plant.finger_mass[2]=0.4")
    words = ("sweep", *WIDTH, *MASS, *SHORT, *values, "--of", "plant.gap[1]", "--plot", "--json")
    code, out, err = command(*words, "--workers", "2")
    assert code == 0, err
    summary = json.loads(out)
    assert (summary["study"], summary["folder"], summary["runs"]) == ("--vary", "sweep", 6)
    assert "drew sweep/map.png" in err
    tables = [pq.read_table(tmp_path / f / "runs.parquet") for f in ("study", "sweep")]
    assert tables[0].equals(tables[1])
    (tmp_path / "sweep/parts/0000004.json").unlink()
    (tmp_path / "study/parts/0000004.json").unlink()
    for folder, left in (("sweep", 5), ("study", 5), ("study", 6)):
        code, out, _ = command(*words, "--out", folder)
        assert (code, json.loads(out)["resumed"]) == (0, left)
    code, _, err = command("sweep", *WIDTH, *SHORT)
    assert (code, err.splitlines()[0]) == (
        2,
        "grasp-cosim: sweep: has the runs of another study; --out must be another folder, or empty",
    )


@pytest.mark.slow
def test_one_that_varies_gives_a_curve(command: Run, tmp_path: Path) -> None:
    code, out, err = command("sweep", *WIDTH, *SHORT, "--of", "target_position", "--plot")
    assert code == 0, err
    assert out.splitlines()[:2] == [
        "--vary: 3 runs, 0 of them done before, 0 failed; in sweep/runs.parquet",
        "plant.object_width: 60 to 70 mm, 3 values",
    ]
    assert [p.name for p in (tmp_path / "sweep").glob("*.png")] == ["curve.png"]


@pytest.mark.slow
def test_a_built_in_study_goes_on_where_its_folder_has_its_name(
    command: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    studies = tmp_path / "studies"
    studies.mkdir()
    (studies / "short.toml").write_text(FILE)
    monkeypatch.setattr("grasp_cosim.grasp.presets.STUDIES", studies)
    for resumed in (0, 6):
        code, out, err = command("sweep", "short", "--workers", "1", "--json")
        assert code == 0, err
        assert json.loads(out)["resumed"] == resumed


WRONG = [
    (("sweep",), "no STUDY; must be a .toml file, the name of a built-in one, or --vary"),
    (("sweep", "x.toml", *WIDTH), "x.toml: must not come with --vary, which is a study without a"),
    (("sweep", *WIDTH, "--seed", "3"), "--seed 3: --vary has nothing that is random; must be left"),
    (("sweep", "x.toml", "--case", "1"), "--case: must come with --vary; a study says it itself"),
    (("sweep", "x.toml", "--case", "0"), "--case: must come with --vary; a study says it itself"),
    (("sweep", "x.toml", "--of", "a"), "--of: must come with --vary; a study says it itself"),
    (("sweep", "x.toml", "--system", "a.toml"), "--system: must come with --vary; a study says"),
    (
        ("sweep", *WIDTH, "--set", "plant.object_width=0.06"),
        "--set plant.object_width: --vary varies it, too; must be in one of them",
    ),
    (("sweep", *WIDTH, "--set", "plant.x=1"), "--set plant.x: "),
    (("sweep", *WIDTH, "--swap", "plant=x.fmu"), "x.fmu: no such FMU file"),
    (("sweep", *WIDTH, "--system", "no.toml"), "no.toml: no such system file"),
    (
        ("sweep", "--vary", "plant.object_width"),
        "--vary 'plant.object_width': must be COMPONENT.VA",
    ),
    (
        ("sweep", *WIDTH, *MASS, "--vary", "sensor_1.reflectance=1,2", "--plot"),
        "--plot: 3 parameter",
    ),
]


@pytest.mark.parametrize(("words", "message"), WRONG)
def test_wrong_input_is_one_line_and_exit_2(
    command: Run, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    code, out, err = command(*words)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert message in err
    assert [*tmp_path.iterdir()] == []
