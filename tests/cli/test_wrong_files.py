"""A file of another kind than a command takes: it says what that is and what to do with it."""

import zipfile
from pathlib import Path

import pytest
from grasp_cosim import InputError, load_run, simulate
from grasp_cosim.ssp.to_archive import write_ssp

FMU = [
    ("inspect", "{}"),
    ("proxy", "{}", "-o", "p.fmu"),
    ("serve", "{}"),
    ("run", "--swap", "plant={}"),
    ("init", "my.toml", "--as", "plant={}"),
    ("qualify", "{}", "--as", "plant"),
]
SYSTEM = [
    ("run", "{}"),
    ("ssp", "{}", "-o", "out.ssp"),
    ("qualify", "p.fmu", "--as", "a", "--system", "{}"),
]


@pytest.fixture
def things(grasp, fmus, tmp_path):
    """One of each: plant.fmu, my.zip, the same; the folder unpacked; a.ssp; a.toml; b.py; run/."""
    plant = tmp_path / "plant.fmu"
    plant.write_bytes((fmus / "GripperPlant.fmu").read_bytes())
    (tmp_path / "my.zip").write_bytes(plant.read_bytes())
    (tmp_path / "p.fmu").write_bytes(plant.read_bytes())
    with zipfile.ZipFile(plant) as archive:
        archive.extractall(tmp_path / "unpacked")
    write_ssp(grasp, tmp_path / "a.ssp")
    (tmp_path / "b.zip").write_bytes((tmp_path / "a.ssp").read_bytes())
    with zipfile.ZipFile(tmp_path / "a.ssp") as archive:
        archive.extractall(tmp_path / "structure")
    (tmp_path / "a.toml").write_text("connections = []\n")
    (tmp_path / "drive.csv").write_text("time,plant.u\n")
    (tmp_path / "OspSystemStructure.xml").write_text("<OspSystemStructure/>\n")
    (tmp_path / "b.py").write_text("import json\n")
    result = simulate(grasp, step=1e-3, stop=0.002)
    (tmp_path / "run").mkdir()
    result.to_json(tmp_path / "run" / "run.json")
    result.to_csv(tmp_path / "run" / "signals.csv")
    return tmp_path


def refused(run, given, what, advice):
    code, out, err = run
    assert (code, out) == (2, ""), err
    line = err.splitlines()[-1]
    assert line.startswith(f"grasp-cosim: {given}: is {what}; must be "), line
    assert advice in line


@pytest.mark.parametrize("arguments", SYSTEM, ids=" ".join)
def test_in_the_place_of_a_system(arguments, command, things):
    report = "`grasp-cosim report run` shows the run"
    for given, what, advice in (
        ("plant.fmu", "an FMU", "`grasp-cosim init my_system.toml --fmu NAME=plant.fmu` makes a"),
        ("plant.fmu", "an FMU", "`grasp-cosim run --swap COMPONENT=plant.fmu` runs that"),
        ("my.zip", "an FMU", "--as COMPONENT=my.zip`"),
        ("b.zip", "an SSP archive", "its name must end in .ssp"),
        ("unpacked", "a folder, unpacked from an FMU", "zip -r - .) > unpacked.fmu` packs it"),
        ("structure", "a folder, unpacked from an SSP archive", "> structure.ssp` packs it"),
        ("run", "a folder that `grasp-cosim run --out` wrote", report),
        ("run/run.json", "a file of a run", report),
        ("run/signals.csv", "a file of a run", report),
        (
            "structure/SystemStructure.ssd",
            "a file unpacked from an SSP archive",
            "> structure.ssp`",
        ),
        (
            "unpacked/modelDescription.xml",
            "a file unpacked from an FMU",
            "> unpacked.fmu` packs it",
        ),
        ("OspSystemStructure.xml", "an XML file", ""),
        ("drive.csv", "a CSV file", "`grasp-cosim run --input drive.csv` drives"),
        (".", "a folder", "there is: a.ssp, a.toml"),
        ("b.py", "a Python file", "`grasp-cosim build b.py` makes an FMU of it, if it is a block"),
    ):
        run = command(*(part.format(given) for part in arguments))
        refused(run, given, what, advice)


@pytest.mark.parametrize("arguments", FMU, ids=" ".join)
def test_in_the_place_of_an_fmu(arguments, command, things):
    for given, what, advice in (
        ("unpacked", "a folder, unpacked from an FMU", "zip -r - .) > unpacked.fmu` packs it"),
        ("run", "a folder that `grasp-cosim run --out` wrote", "`grasp-cosim report run`"),
        ("run/signals.csv", "a file of a run", "`grasp-cosim report run` shows the run"),
        (".", "a folder", "there is: p.fmu, plant.fmu"),
        ("b.py", "a Python file", "`grasp-cosim build b.py` makes an FMU of it, if it is a block"),
        *(
            (("a.ssp", "an SSP archive", "`grasp-cosim run a.ssp` runs it; its FMUs are in it"),
             ("a.toml", "a TOML file", "`grasp-cosim run a.toml` runs it, if it is a system"))
            if arguments[0] != "qualify" else ()  # which takes a system file with the candidate
        ),
    ):  # fmt: skip
        run = command(*(part.format(given) for part in arguments))
        refused(run, given, what, advice)
    assert command("inspect", "my.zip")[0] == 0


@pytest.mark.slow
def test_in_the_place_of_a_run(command, things):
    for given in ("run/run.json", "run/signals.csv"):
        assert command("report", given)[0] == 0
        assert Path("run/report.html").is_file()
        Path("run/report.html").unlink()
        assert load_run(given).metrics["steps"] == 2
    for given, what, advice in (
        ("plant.fmu", "an FMU", "`grasp-cosim inspect plant.fmu` shows it"),
        ("a.ssp", "an SSP archive", "`grasp-cosim run a.ssp` runs it"),
        ("a.toml", "a TOML file", "`grasp-cosim run a.toml` runs it"),
        (".", "a folder", "there is: run"),
    ):
        refused(command("report", given), given, what, advice)
    with pytest.raises(InputError, match=r"plant.fmu: is an FMU; must be a folder that"):
        load_run("plant.fmu")


def test_what_is_damaged_or_unknown_is_said_as_before(command, tmp_path):
    (tmp_path / "x.fmu").write_bytes(b"PK\x03\x04")
    assert "x.fmu: not a readable FMU" in command("inspect", "x.fmu")[2]
    (tmp_path / "x.toml").write_text("x")
    assert "x.toml: not readable as TOML" in command("run", "x.toml")[2]
    assert "none.toml: no such system file" in command("run", "none.toml")[2]
    assert "none.fmu: no such FMU file" in command("inspect", "none.fmu")[2]


TABLE = "[experiment]\nstep = 0.1\nstop = 1.0\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TABLE + "stop = 2.0\n", "(at line 4, column 11): stop = 2.0"),
        (f"{TABLE}\n[a]\n{TABLE}", "(at line 6, column 12): [experiment]"),
        (TABLE + "stop 2.0", "(at line 4, column 6): stop 2.0"),
        ("\ufeff" + TABLE, "[components]: missing"),  # a byte order mark, as some editors write it
    ],
)
def test_a_line_of_toml_is_named(text, said, command, tmp_path):
    (tmp_path / "a.toml").write_text(text, "utf-8")
    code, out, err = command("run", "a.toml")
    assert (code, out) == (2, "")
    assert said in err
