"""Files of commands: written through links and into pipes, named where wrong, not run by chance."""

import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path
from threading import Thread

import pytest
from grasp_cosim import InputError, load_run, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from grasp_cosim.ssp.to_archive import write_ssp

WRITERS = {
    "comparison.html": ("compare", "run", "run", "-o"),
    "grasp.ssp": ("ssp", "-o"),
    "proxy.fmu": ("proxy", "GripperPlant.fmu", "-o"),
    "report.html": ("report", "run", "--out"),
    "table.csv": ("sweep", "--set", "experiment.stop=0.01", "--set", "experiment.step=1e-3",
                  "--vary", "plant.object_width=0.04,0.05", "--workers", "1", "--out"),
    "qualification.html": ("qualify", "GripperPlant.fmu", "--as", "plant", "--step", "1e-3",
                           "--stop", "0.05", "-o"),
    "system.toml": ("init", "--force"),
}  # fmt: skip
SLOW = ("qualification.html",)
EACH = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in WRITERS],
)


def record(grasp, folder, stop=0.01):
    folder.mkdir()
    result = simulate(grasp, step=1e-3, stop=stop)
    result.to_json(folder / "run.json")
    result.to_csv(folder / "signals.csv")


@pytest.fixture
def here(grasp, fmus, tmp_path):
    record(grasp, tmp_path / "run")
    (tmp_path / "GripperPlant.fmu").write_bytes((fmus / "GripperPlant.fmu").read_bytes())
    return tmp_path


@EACH
def test_a_pipe_has_its_reader_get_it(name, command, here):
    pipe = here / name
    os.mkfifo(pipe)
    found = []
    reader = Thread(target=lambda: found.append(pipe.read_bytes()), daemon=True)
    reader.start()
    code, _, err = command(*WRITERS[name], name)
    assert code == 0, err
    reader.join(10.0)
    assert len(found[0]) > 100
    assert pipe.is_fifo()


@EACH
def test_a_link_stays_and_a_folder_is_refused(name, command, here):
    (here / "other").mkdir()
    (here / name).symlink_to(Path("other") / f"own_{name}")
    code, _, err = command(*WRITERS[name], name)
    assert code == 0, err
    assert (here / name).is_symlink()
    assert (here / "other" / f"own_{name}").stat().st_size > 100
    (here / name).unlink()
    (here / name).mkdir()
    code, out, err = command(*WRITERS[name], name)
    assert (code, out) == (2, ""), err
    assert f"{name}: is a folder; must be" in err.splitlines()[-1]
    assert list((here / name).iterdir()) == []


def test_a_run_is_not_written_in_the_place_of_a_file(command, here):
    (here / "file").touch()
    code, out, err = command("run", "--stop", "0.01", "--out", "file")
    assert (code, out) == (2, "")
    assert err == f"grasp-cosim: file: cannot write to {here}/file: Not a directory\n"


@pytest.mark.parametrize("target", ["new", "deep/er/new"])
def test_a_folder_is_made_where_a_dangling_link_leads(command, here, target):
    (here / "link").symlink_to(target)
    code, _, err = command("run", "--stop", "0.01", "--out", "link")
    assert code == 0, err
    assert (here / "link").is_symlink()
    assert (here / target / "run.json").is_file()


def test_a_link_to_itself_is_refused(command, here):
    (here / "link").symlink_to("link")
    code, out, err = command("run", "--stop", "0.01", "--out", "link")
    assert (code, out) == (2, "")
    assert err.startswith("grasp-cosim: link")
    assert err.count("\n") == 1


def test_the_files_of_a_run_go_through_links_and_pipes(command, here):
    folder, found = here / "run", []
    (folder / "signals.csv").unlink()
    os.mkfifo(folder / "signals.csv")
    (folder / "run.json").rename(here / "own.json")
    (folder / "run.json").symlink_to(Path("..") / "own.json")
    reader = Thread(target=lambda: found.append((folder / "signals.csv").read_bytes()), daemon=True)
    reader.start()
    code, _, err = command("run", "--stop", "0.02", "--out", "run")
    assert code == 0, err
    reader.join(10.0)
    assert found[0].count(b"\n") == 202
    assert (folder / "run.json").is_symlink()
    assert '"steps": 200,' in (here / "own.json").read_text()


# A file of another kind than a command takes: it says what that is and what to do with it.

FMU = [
    *("inspect {}", "proxy {} -o p.fmu", "serve {}", "run --swap plant={}"),
    *("init my.toml --as plant={}", "qualify {} --as plant"),
]
OF_A_SYSTEM = ["run {}", "ssp {} -o out.ssp", "qualify plant.fmu --as a --system {}"]
BLOCK = ("b.py", "a .py file", "`grasp-cosim build b.py` makes an FMU of it, if it is a block")
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
    ("OspSystemStructure.xml", "a .xml file", ""),
    ("drive.csv", "a .csv file", "`grasp-cosim run --input drive.csv` drives"),
    (".", "a folder", ""),
    *(BLOCK, *OF_THE_RUN),
]
NOT_AN_FMU = [
    (".", "a folder", ""),
    *(BLOCK, *OF_THE_RUN),
    ("a.ssp", "an SSP archive", "`grasp-cosim run a.ssp` runs it; its FMUs are in it"),
    ("a.toml", "a .toml file", "`grasp-cosim run a.toml` runs it, if it is a system"),
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
    record(grasp, tmp_path / "run", 0.002)


@pytest.mark.usefixtures("things")
@pytest.mark.parametrize(
    ("line", "rows"),
    [
        *((line, NOT_A_SYSTEM) for line in OF_A_SYSTEM),
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
        ("[a]\nstep = 1/30  # s\n", '1/30  # s; a fraction must be in quotes, like "1/30"'),
        (f"{TABLE}\n[a]\n{TABLE}", "(at line 6, column 12): [experiment]"),
        ("\ufeff" + TABLE, "[components]: missing"),  # a byte order mark, as some editors write it
    ],
)
def test_a_line_of_toml_is_named(text, said, command, tmp_path):
    (tmp_path / "a.toml").write_text(text, "utf-8")
    code, out, err = command("run", "a.toml")
    assert (code, out) == (2, "")
    assert said in err


# Modules in the current folder, which may be that of a stranger, are not run.

MARK = "imported.txt"
BLOCK_FILE = TEMPLATE_FOLDER / "spring_plant.py"


def poison(folder, names):
    """A folder of modules, each of which notes that it was imported, and fails."""
    folder.mkdir()
    for name in filter(str.isidentifier, names):
        noted = f"open({str(folder / MARK)!r}, 'a').write({name!r} + ' ')"
        (folder / f"{name}.py").write_text(f"{noted}\nraise ImportError({name!r})\n")
    return folder


@pytest.fixture
def everything(tmp_path):
    """All that Python and its packages have, under false colours."""
    ours = {"sitecustomize", "usercustomize"}
    return poison(
        tmp_path / "strange", {*sys.stdlib_module_names, *packages_distributions(), *ours}
    )


@pytest.fixture
def system(fmus, tmp_path):
    """The grasp as a file."""
    path = tmp_path / "grasp.toml"
    path.write_text(SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/'), "utf-8")
    return path


def not_imported(folder, command, *arguments):
    """What a command that stands in the folder says; it imports nothing from there."""
    done = subprocess.run(
        [sys.executable, *command, *arguments],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    imported = folder / MARK
    assert not imported.exists(), imported.read_text()
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.fixture
def installed(tmp_path):
    """As the installed command starts: its own folder is the first to look into."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "grasp-cosim.py"
    program.write_text(
        "from grasp_cosim.cli import entry\nif __name__ == '__main__':\n    entry()\n"
    )
    return [str(program)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "run {SYSTEM} --stop 0.001",
        "run {SYSTEM} --stop 0.001 --set components.plant.isolation=process",
        "qualify {FMUS}/GripperPlant.fmu --as plant --system {SYSTEM} --stop 0.001",
        "inspect {FMUS}/GripperPlant.fmu --load",
        "inspect {FMUS}/GripperPlant.fmu",
        "sweep {SYSTEM} --stop 0.001 --vary plant.object_width=0.05,0.06 --out {OUT} --workers 2",
        "ssp {SYSTEM} -o {OUT}.ssp",
        "build {BLOCK} --out {OUT}",
        "proxy {FMUS}/GripperPlant.fmu -o {OUT}.fmu",
    ],
)
def test_a_command(line, installed, everything, system, fmus, tmp_path):
    places = {"SYSTEM": system, "FMUS": fmus, "BLOCK": BLOCK_FILE, "OUT": tmp_path / "out"}
    not_imported(everything, installed, *(word.format(**places) for word in line.split()))


@pytest.mark.slow
def test_python_m_imports_what_it_needs_to_find_us_alone(tmp_path, system):
    names = {"numpy", "socket", "click", "fmpy", "lxml", "ctypes", "tomllib", "multiprocessing"}
    folder, here = poison(tmp_path / "strange", names), ("-m", "grasp_cosim")
    isolated = ("--set", "components.plant.isolation=process")
    not_imported(folder, here, "run", str(system), "--stop", "0.001", *isolated)
