"""FMUs that do not run here: each command says in one line what they are and what to ask for."""

import re
import zipfile

import fmpy
import pytest
from grasp_cosim.inspection.loading import examine
from support.compiled import binary
from support.native_fmus import build, library_of, needs_gcc, starts_text


def _described(before, after):
    def change(files):
        xml = files["modelDescription.xml"].decode()
        assert before in xml
        return files | {"modelDescription.xml": xml.replace(before, after).encode()}

    return change


def _moved(folder):
    """The binaries for another machine, or as sources."""
    to = f"binaries/{folder}/native.{'dll' if folder.startswith('win') else 'so'}"
    to = "sources/native.c" if folder == "sources" else to
    return lambda files: {re.sub("^binaries/.*", to, name): data for name, data in files.items()}


def _without_binary(files):
    return {name: data for name, data in files.items() if not name.startswith("binaries/")}


def _one(files):
    """FMI 1.0, which has its kind in an element of its own; of ours that is enough to tell."""
    xml = files["modelDescription.xml"].decode().replace('fmiVersion="2.0"', 'fmiVersion="1.0"')
    xml = re.sub("<CoSimulation([^>]*)/>", "", xml)
    return files | {"modelDescription.xml": xml.encode()}


def _one_stepping(files):
    xml = _one(files)["modelDescription.xml"].decode()
    tool = "<Implementation><CoSimulation_StandAlone><Capabilities/></CoSimulation_StandAlone>"
    xml = xml.replace("</fmiModelDescription>", f"{tool}</Implementation></fmiModelDescription>")
    return files | {"modelDescription.xml": xml.encode()}


ASK = "ask the vendor for an export as FMI 2.0 or 3.0, for co-simulation"
HERE, HERE_3 = fmpy.platform, fmpy.platform_tuple
BINARY, BINARY_3 = (f"ask the vendor for an FMU with a binary for {p}" for p in (HERE, HERE_3))

KINDS = {
    "fmi 1.0": ("2.0", _one, "is FMI 1.0, for model exchange", ASK),
    "fmi 1.0 stepping": ("2.0", _one_stepping, "is FMI 1.0, for co-simulation", ASK),
    "scheduled": (
        "3.0",
        _described("<CoSimulation", "<ScheduledExecution"),
        "is for scheduled execution only",
        ASK,
    ),
}
"""What no machine runs: the version, the change, what is said of it, and what to ask for."""

BINARIES = {
    "windows": ("2.0", _moved("win64"), f"for win64 only; this machine: {HERE}", BINARY),
    "arm": ("3.0", _moved("aarch64-linux"), "has a binary for aarch64-linux only", BINARY_3),
    "sources": ("2.0", _moved("sources"), "is source-only, C without a binary", BINARY),
    "nothing": ("3.0", _without_binary, "has no binary at all", BINARY_3),
}
"""What this machine does not run."""


def refused(folder, name):
    """The FMU x.fmu of that kind in a folder."""
    version, change, *_ = (KINDS | BINARIES)[name]
    return changed(build(folder, "whole", version), folder / "x.fmu", change)


def changed(fmu, out, change):
    """A copy of an FMU with its files changed."""
    with zipfile.ZipFile(fmu) as archive:
        files = {n: archive.read(n) for n in archive.namelist() if not n.endswith("/")}
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in change(files).items():
            archive.writestr(name, data)
    return out


def system(version="2.0"):
    return (
        "[experiment]\nstep = 0.1\nstop = 1.0\n"
        f'[components.a]\nfmu = "x.fmu"\nvalues = {{ {starts_text(version)} }}\n'
    )


def found(fmu):
    return {finding.check: finding for finding in examine(fmu, load=True)}


def one_line(run, what, ask):
    """It is wrong input, said of x.fmu as it was given, in one line, without a folder of ours."""
    code, out, err = run
    assert (code, out) == (2, ""), err
    line = err.splitlines()[-1]
    assert "x.fmu" in line
    assert what in line
    assert ask in line
    assert "grasp_scratch" not in err
    assert "Traceback" not in err


@needs_gcc
@pytest.mark.parametrize("name", KINDS)
def test_a_kind_that_no_machine_runs(name, command, tmp_path):
    _, _, what, ask = KINDS[name]
    fmu = refused(tmp_path, name)
    verdict = found(fmu)["fmu"]
    assert verdict.status == "problem"
    assert what in verdict.text
    assert ask in (verdict.fix or "")
    (tmp_path / "s.toml").write_text(system())
    for arguments in (
        ("run", "s.toml"),
        ("run", "--swap", "plant=x.fmu"),
        ("qualify", "x.fmu", "--as", "plant"),
        ("ssp", "s.toml", "-o", "s.ssp"),
        ("init", "my.toml", "--as", "plant=x.fmu"),
        ("init", "my.toml", "--fmu", "x=x.fmu"),
        ("proxy", "x.fmu", "-o", "p.fmu"),
        ("serve", "x.fmu", "--port", "0"),
    ):
        one_line(command(*arguments), f"x.fmu: {what}", ask)
    assert command("inspect", "x.fmu")[0] == 1


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("name", BINARIES)
def test_a_binary_for_others(name, command, tmp_path):
    version, _, what, ask = BINARIES[name]
    fmu = refused(tmp_path, name)
    verdict = found(fmu)["binary"]
    assert verdict.status == "problem"
    assert what in verdict.text
    assert ask in (verdict.fix or "")
    assert ("fmpy compile" in (verdict.fix or "")) == (name == "sources")
    (tmp_path / "s.toml").write_text(system(version))
    one_line(command("run", "s.toml"), f"a: x.fmu {what}" if name != "windows" else what, ask)
    one_line(command("run", "s.toml", "--set", "components.a.isolation=process"), what, ask)
    code, _, err = command("ssp", "s.toml", "-o", "s.ssp")  # which may be for another machine
    assert code == 0
    assert what in err
    one_line(command("run", "s.ssp"), what, ask)


@pytest.mark.slow
@needs_gcc
def test_one_that_needs_its_tool(command, tmp_path):
    capable = {"needsExecutionTool": "true"}
    build(tmp_path, "x", "2.0", capabilities=capable)
    verdict = found(tmp_path / "x.fmu")["fmu"]
    assert verdict.status == "warning"
    assert "needs it here (needsExecutionTool)" in verdict.text
    assert "an export that runs by itself" in (verdict.fix or "")
    changed(
        tmp_path / "x.fmu",
        tmp_path / "y.fmu",
        lambda f: (
            {n: d.replace(b"{native}", b"{other}") for n, d in f.items() if "/" not in n}
            | {n: d for n, d in f.items() if "/" in n}
        ),
    ).replace(tmp_path / "x.fmu")
    (tmp_path / "s.toml").write_text(system())
    run = command("run", "s.toml")
    one_line(run, "x.fmu does not load", "ask the vendor for an export that runs by itself")


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("isolation", ["none", "process"])
def test_one_without_its_licence(isolation, command, tmp_path):
    library = library_of("native", "2.0", more=["-DNO_LICENCE"])
    whole = build(tmp_path, "whole", "2.0")
    place = binary("2.0", "native")
    changed(whole, tmp_path / "x.fmu", lambda files: files | {place: library})
    trial = found(tmp_path / "x.fmu")["trial"]
    assert trial.status == "problem"
    assert "No license" in trial.text
    assert "ask the vendor for an export that needs none" in (trial.fix or "")
    (tmp_path / "s.toml").write_text(system())
    run = command("run", "s.toml", "--set", f"components.a.isolation={isolation}")
    one_line(run, "No license for feature X in resources/key; it needs a licence on", "needs none")


def test_one_that_is_encrypted(command, tmp_path):
    with zipfile.ZipFile(tmp_path / "x.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "<x/>")
    data = bytearray((tmp_path / "x.fmu").read_bytes())
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + place] |= 1
    (tmp_path / "x.fmu").write_bytes(data)
    (tmp_path / "s.toml").write_text(system())
    for arguments in (("run", "s.toml"), ("inspect", "x.fmu")):
        run = command(*arguments)
        one_line(run, "modelDescription.xml is encrypted", "ask the vendor for it without a pass")
