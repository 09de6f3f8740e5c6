"""What docs/studies.md says of studies is so: its commands, its files, its tables of keys."""

import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_cosim.cli.frame import load_system, with_controller, with_preset
from grasp_cosim.grasp.presets import STUDIES, SYSTEM
from grasp_cosim.sweep.design import KINDS
from grasp_cosim.sweep.read import FORMS, KEYS, Made, read_studies
from grasp_cosim.sweep.study import CELLS, STATISTICS, Curve, Map, Pictures

Run = Callable[..., tuple[int, str, str]]

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/studies.md").read_text("utf-8")
OWN, ALL = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
(READ,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
(SHOWN,) = re.findall(r"```\n(--vary.*?)```", PAGE, re.DOTALL)
COMMANDS = [
    shlex.split(command)
    for command in re.findall(
        r"^    \.venv/bin/grasp-cosim (.*)$", PAGE.replace("\\\n", " "), re.MULTILINE
    )
]


def rows(head: str) -> list[list[str]]:
    """The cells of the one table with that heading."""
    _, found = PAGE.split(f"\n| {head} |", 1)
    body = found.split("\n\n", 1)[0].splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in body]


def named(head: str) -> list[str]:
    """What stands in backticks in the first column of a table."""
    return [name for row in rows(head) for name in re.findall(r"`([\w-]+)", row[0])]


def test_every_key_is_there_and_no_other() -> None:
    assert sorted(named("key")) == sorted(KEYS)
    assert named("form") == [*FORMS]
    assert named("kind") == [*KINDS]
    entries = {*named("entry")}
    assert entries == {*Map.__slots__} == {*Curve.__slots__, "y"}
    assert {f'"{cell}"' for cell in CELLS} <= {*re.findall(r'`("\w+")`', PAGE)}
    assert ", ".join(f"`{s}`" for s in STATISTICS) in " ".join(PAGE.split())


@pytest.mark.usefixtures("built_in")
def test_the_built_in_studies_and_their_runs(fmus: Path) -> None:
    made = Made(load_system, with_preset, with_controller, fmus)
    listed = {name: int(runs) for name, _, runs, _ in rows("NAME")}
    assert {*listed} == {path.stem for path in STUDIES.glob("*.toml")}
    for name, runs in listed.items():
        found = read_studies(STUDIES / f"{name}.toml", made)
        assert runs == sum(study.runs for study in found), name


@pytest.fixture
def folder(checkout: Path, metrics_of_the_readme: str) -> Path:
    """A checkout with what the page's files name."""
    shutil.copy(checkout / "fmus/build/GripperPlant.fmu", checkout / "vendor.fmu")
    text = SYSTEM.read_text("utf-8").replace('fmu = "', 'fmu = "fmus/build/')
    dark = '[presets.dark]\n"sensor_1.reflectance" = 0.3\n"sensor_2.reflectance" = 0.3\n'
    (checkout / "my_system.toml").write_text(f"{text}\n{dark}")
    (checkout / "my_metrics.py").write_text(metrics_of_the_readme)
    (checkout / "my_study.toml").write_text(OWN)
    (checkout / "all.toml").write_text(ALL)
    return checkout


@pytest.fixture
def metrics_of_the_readme() -> str:
    readme = (ROOT / "README.md").read_text("utf-8")
    first, *_ = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    return str(first)


def test_the_file_with_all_keys_is_one(folder: Path) -> None:
    made = Made(load_system, with_preset, with_controller)
    first, second = read_studies(folder / "all.toml", made)
    assert [study.runs for study in (first, second)] == [63, 63]
    fmus = [study.system.component("plant", "test").fmu.name for study in (first, second)]
    assert fmus == ["vendor.fmu"] * 2
    assert first.system.component("controller", "test").fmu.name == "GraspController.fmu"
    assert second.system.component("controller", "test").fmu.name == "GraspControllerAdaptive.fmu"
    keys = {line.split(" ")[0] for line in ALL.splitlines() if " = " in line} | {
        *re.findall(r"^\[+(\w+)", ALL, re.MULTILINE)
    }
    assert keys >= KEYS - {"bench"}
    assert first.pictures != Pictures()


@pytest.mark.slow
def test_the_study_of_ones_own(
    folder: Path, command: Run, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All 40 grasps are as soft as it asks; then the page's way to read what they left."""
    monkeypatch.chdir(folder)
    (used,) = re.findall(r"for grasp-cosim (sweep my_study.toml --plot)", OWN)
    code, out, err = command(*used.split())
    assert code == 0, out + err
    assert re.search(
        r"^kept    impact_velocity\[1\]: greatest \S+ mm/s, at most 8 mm/s$", out, re.M
    )
    files = {path.name for path in (folder / "my_study").iterdir()}
    said = {name for row in rows("file") for name in re.findall(r"`([\w.]+)", row[0])}
    assert files == said - {"sensitivity.json", "curve.png"}
    exec(READ, {})
    printed = capsys.readouterr().out
    assert "'object position', 'width', 'time_to_contact[1]'" in printed
    assert re.search(r"^\d+\.\d ms apart at most$", printed, re.M)


@pytest.mark.slow
def test_the_commands_without_a_file(
    folder: Path, command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    assert [words[0] for words in COMMANDS] == ["sweep", "sweep"]
    one, two = COMMANDS
    code, out, err = command(*one)
    assert code == 0, err
    assert out.startswith(SHOWN)
    assert (folder / "sweep/curve.png").is_file()
    code, out, err = command(*two)
    assert code == 0, err
    assert out.startswith("--vary: 55 runs, 0 of them done before, 0 failed; in map/runs.parquet")
    assert (folder / "map/map.png").is_file()
