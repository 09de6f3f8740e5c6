"""FMUs that do not run here: each command says in one line what they are and what to ask for."""

import re
import zipfile

import fmpy
import pytest
from grasp_cosim.base.scratch import PREFIX
from support.compiled import binary
from support.native_fmus import build, library_of, needs_gcc, starts_text


def _scheduled(files):
    return _described(files, "<CoSimulation", "<ScheduledExecution")


def _one(files):
    """FMI 1.0, which has its kind in an element of its own; of ours that is enough to tell."""
    return _described(files, 'fmiVersion="2.0"', 'fmiVersion="1.0"', "<CoSimulation[^>]*/>")


def _described(files, before, after, gone="$"):
    xml = files["modelDescription.xml"].decode()
    assert before in xml
    return files | {"modelDescription.xml": re.sub(gone, "", xml.replace(before, after)).encode()}


def _moved(folder):
    """The binaries for another machine, or as sources."""
    to = f"binaries/{folder}/native.{'dll' if folder.startswith('win') else 'so'}"
    to = "sources/native.c" if folder == "sources" else to
    return lambda files: {re.sub("^binaries/.*", to, name): data for name, data in files.items()}


def _without_binary(files):
    return {name: data for name, data in files.items() if not name.startswith("binaries/")}


ASK = "ask the vendor for an export as FMI 2.0 or 3.0, for co-simulation"
HERE, HERE_3 = fmpy.platform, fmpy.platform_tuple
BINARY, BINARY_3 = (f"ask the vendor for an FMU with a binary for {p}" for p in (HERE, HERE_3))


def changed(fmu, out, change):
    """A copy of an FMU with its files changed."""
    with zipfile.ZipFile(fmu) as archive:
        files = {n: archive.read(n) for n in archive.namelist() if not n.endswith("/")}
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in change(files).items():
            archive.writestr(name, data)


@pytest.fixture
def refused(tmp_path):
    """Makes x.fmu, of a version and changed, and a system with it, s.toml."""

    def make(version, change):
        changed(build(tmp_path, "whole", version), tmp_path / "x.fmu", change)
        (tmp_path / "s.toml").write_text(
            "[experiment]\nstep = 0.1\nstop = 1.0\n"
            f'[components.a]\nfmu = "x.fmu"\nvalues = {{ {starts_text(version)} }}\n'
        )

    return make


def one_line(run, what, ask):
    """It is wrong input, said of x.fmu as it was given, in one line, without a folder of ours."""
    code, out, err = run
    assert (code, out) == (2, ""), err
    line = err.splitlines()[-1]
    assert "x.fmu" in line
    assert what in line
    assert ask in line
    assert PREFIX not in err
    assert "Traceback" not in err


@needs_gcc
@pytest.mark.parametrize(
    ("version", "change", "what"),
    [
        ("2.0", _one, "is FMI 1.0, for model exchange"),
        ("3.0", _scheduled, "is for scheduled execution only"),
    ],
)
def test_a_kind_that_no_machine_runs(version, change, what, refused, command):
    refused(version, change)
    for line in (
        "run s.toml",
        "run --swap plant=x.fmu",
        "qualify x.fmu --as plant",
        "ssp s.toml -o s.ssp",
        "init my.toml --as plant=x.fmu",
        "init my.toml --fmu x=x.fmu",
        "proxy x.fmu -o p.fmu",
        "serve x.fmu --port 0",
    ):
        one_line(command(*line.split()), f"x.fmu: {what}", ASK)
    assert command("inspect", "x.fmu")[0] == 1


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize(
    ("version", "change", "what", "ask"),
    [
        ("2.0", _moved("win64"), f"for win64 only; this machine: {HERE}", BINARY),
        ("3.0", _moved("aarch64-linux"), "a: x.fmu has a binary for aarch64-linux only", BINARY_3),
        ("2.0", _moved("sources"), "a: x.fmu is source-only, C without a binary", BINARY),
        ("3.0", _without_binary, "a: x.fmu has no binary at all", BINARY_3),
    ],
)
def test_a_binary_for_others(version, change, what, ask, refused, command):
    refused(version, change)
    one_line(command("run", "s.toml"), what, ask)
    one_line(command("run", "s.toml", "--set", "components.a.isolation=process"), what, ask)
    code, _, err = command("ssp", "s.toml", "-o", "s.ssp")  # which may be for another machine
    assert (code, what.removeprefix("a: x.fmu ") in err) == (0, True)
    one_line(command("run", "s.ssp"), what.removeprefix("a: x.fmu "), ask)


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("isolation", ["none", "process"])
def test_one_without_its_licence(isolation, refused, command):
    library, place = library_of("native", "2.0", more=["-DNO_LICENCE"]), binary("2.0", "native")
    refused("2.0", lambda files: files | {place: library})
    run = command("run", "s.toml", "--set", f"components.a.isolation={isolation}")
    one_line(run, "No license for feature X in resources/key; it needs a licence on", "needs none")


def test_one_that_is_encrypted(command, tmp_path):
    with zipfile.ZipFile(tmp_path / "x.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<x/>")
    data = bytearray((tmp_path / "x.fmu").read_bytes())
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + place] |= 1
    (tmp_path / "x.fmu").write_bytes(data)
    for line in ("run --swap plant=x.fmu", "inspect x.fmu"):
        run = command(*line.split())
        one_line(run, "modelDescription.xml is encrypted", "ask the vendor for it without a pass")
