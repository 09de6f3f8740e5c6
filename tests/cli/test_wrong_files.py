"""A file of another kind than a command takes: it says what that is and what to do with it."""

from pathlib import Path

import pytest
from grasp_cosim import InputError, load_run, simulate
from grasp_cosim.ssp.to_archive import write_ssp

FMU = [
    *("inspect {}", "proxy {} -o p.fmu", "serve {}", "run --swap plant={}"),
    *("init my.toml --as plant={}", "qualify {} --as plant"),
]
SYSTEM = ["run {}", "ssp {} -o out.ssp", "qualify plant.fmu --as a --system {}"]
BLOCK = ("b.py", "a Python file", "`grasp-cosim build b.py` makes an FMU of it, if it is a block")
REPORT = "`grasp-cosim report run` shows the run"
OF_THE_RUN = [
    ("run", "a folder that `grasp-cosim run --out` wrote", REPORT),
    ("run/signals.csv", "a file of a run", REPORT),
]
NOT_A_SYSTEM = [
    ("plant.fmu", "an FMU", "`grasp-cosim init my_system.toml --fmu NAME=plant.fmu` makes a"),
    ("plant.fmu", "an FMU", "`grasp-cosim run --swap COMPONENT=plant.fmu` runs that"),
    ("my.zip", "an FMU", "--as COMPONENT=my.zip`"),
    ("b.zip", "an SSP archive", "its name must end in .ssp"),
    ("run/run.json", "a file of a run", REPORT),
    ("OspSystemStructure.xml", "an XML file", ""),
    ("drive.csv", "a CSV file", "`grasp-cosim run --input drive.csv` drives"),
    (".", "a folder", ""),
    *(BLOCK, *OF_THE_RUN),
]
NOT_AN_FMU = [
    (".", "a folder", ""),
    *(BLOCK, *OF_THE_RUN),
    ("a.ssp", "an SSP archive", "`grasp-cosim run a.ssp` runs it; its FMUs are in it"),
    ("a.toml", "a TOML file", "`grasp-cosim run a.toml` runs it, if it is a system"),
]
NOT_A_RUN = [
    ("plant.fmu", "an FMU", "`grasp-cosim inspect plant.fmu` shows it"),
    *NOT_AN_FMU[-2:],
]


@pytest.fixture
def things(grasp, fmus, tmp_path):
    """One of each: plant.fmu, my.zip, the same; a.ssp; a.toml; b.py; run/."""
    for name in ("plant.fmu", "my.zip"):
        (tmp_path / name).write_bytes((fmus / "GripperPlant.fmu").read_bytes())
    write_ssp(grasp, tmp_path / "a.ssp")
    (tmp_path / "b.zip").write_bytes((tmp_path / "a.ssp").read_bytes())
    (tmp_path / "a.toml").write_text("connections = []\n")
    (tmp_path / "drive.csv").write_text("time,plant.u\n")
    (tmp_path / "OspSystemStructure.xml").write_text("<OspSystemStructure/>\n")
    (tmp_path / "b.py").write_text("import json\n")
    result = simulate(grasp, step=1e-3, stop=0.002)
    (tmp_path / "run").mkdir()
    result.to_json(tmp_path / "run" / "run.json")
    result.to_csv(tmp_path / "run" / "signals.csv")


@pytest.mark.usefixtures("things")
@pytest.mark.parametrize(
    ("line", "rows"),
    [
        *((line, NOT_A_SYSTEM) for line in SYSTEM),
        *((line, NOT_AN_FMU) for line in FMU[:-1]),
        (FMU[-1], NOT_AN_FMU[:-2]),  # which takes a system file with the candidate
        ("report {}", NOT_A_RUN),
    ],
)
def test_it_is_said_what_it_is(command, line, rows):
    for given, what, advice in rows:
        code, out, err = command(*line.format(given).split())
        assert (code, out) == (2, ""), err
        said = err.splitlines()[-1]
        assert said.startswith(f"grasp-cosim: {given}: is {what}; must be "), said
        assert advice in said


@pytest.mark.slow
@pytest.mark.usefixtures("things")
def test_what_is_as_good_is_taken(command):
    assert command("inspect", "my.zip")[0] == 0
    for given in ("run/run.json", "run/signals.csv"):
        assert command("report", given)[0] == 0
        assert Path("run/report.html").is_file()
        Path("run/report.html").unlink()
        assert load_run(given).metrics["steps"] == 2
    with pytest.raises(InputError, match=r"plant.fmu: is an FMU; must be a folder that"):
        load_run("plant.fmu")


TABLE = "[experiment]\nstep = 0.1\nstop = 1.0\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x", "a.toml: not readable as TOML"),
        (TABLE + "stop = 2.0\n", "(at line 4, column 11): stop = 2.0"),
        (f"{TABLE}\n[a]\n{TABLE}", "(at line 6, column 12): [experiment]"),
        ("\ufeff" + TABLE, "[components]: missing"),  # a byte order mark, as some editors write it
    ],
)
def test_a_line_of_toml_is_named(text, said, command, tmp_path):
    (tmp_path / "a.toml").write_text(text, "utf-8")
    code, out, err = command("run", "a.toml")
    assert (code, out) == (2, "")
    assert said in err
