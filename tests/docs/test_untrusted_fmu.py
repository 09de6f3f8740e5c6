"""The table of docs/how_to/untrusted_fmu.md: commands that run code of an FMU, and that read it."""

import os
import zipfile
from pathlib import Path

import pytest
from grasp_cosim.cli import main
from support.native_fmus import TYPES, build, library_of, needs_gcc

PAGE = (Path(__file__).parents[2] / "docs/how_to/untrusted_fmu.md").read_text("utf-8")
STARTS = {"Boolean": "false", "String": "''", "Enumeration": "1"}
TELL_TALE = """
#include <stdio.h>
#include <unistd.h>
__attribute__((constructor)) static void loaded(void) {
    FILE *file = fopen("LOG", "a");
    fprintf(file, "%d\\n", (int)getpid());
    fclose(file);
}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A system with an FMU that leaves the number of each process that loads it in the file log."""
    monkeypatch.chdir(tmp_path)
    fmu = build(tmp_path, "a", "2.0")
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    binary = next(name for name in files if name.startswith("binaries/") and name[-1] != "/")
    tell_tale = TELL_TALE.replace("LOG", str(tmp_path / "log"))
    files[binary] = library_of("native", "2.0", code=tell_tale)
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    values = ", ".join(f"u_{t} = {STARTS.get(t, '0')}" for t in TYPES["2.0"])
    (tmp_path / "system.toml").write_text(
        '[experiment]\nstep = 0.05\nstop = 0.1\n[components.a]\nfmu = "a.fmu"\n'
        f"values = {{ {values} }}\n"
    )
    return tmp_path


def loaded(folder, *arguments):
    """The processes that load the FMU in a command."""
    log = folder / "log"
    log.unlink(missing_ok=True)
    assert main(list(arguments)) in (0, 1)
    return {int(line) for line in log.read_text().split()} if log.exists() else set()


@needs_gcc
def test_what_only_reads(folder):
    assert "| `inspect`, `init`, `ssp`, `proxy`, `report` | reads it" in PAGE
    assert loaded(folder, "run", "system.toml", "--out", "results") == {os.getpid()}
    assert not loaded(folder, "inspect", "a.fmu")
    assert not loaded(folder, "init", "alone.toml", "--fmu", "a=a.fmu")
    assert not loaded(folder, "ssp", "system.toml", "-o", "system.ssp")
    assert not loaded(folder, "ssp", "system.ssp", "-o", "again.ssp")
    assert not loaded(folder, "proxy", "a.fmu", "-o", "proxy.fmu")
    assert not loaded(folder, "report", "results")


@pytest.mark.slow
@needs_gcc
def test_what_loads_it_in_another_process(folder):
    assert "| `inspect --load FMU` |" in PAGE
    assert loaded(folder, "inspect", "--load", "a.fmu") - {os.getpid()}
    assert os.getpid() not in loaded(folder, "inspect", "--load", "a.fmu")
    isolated = loaded(folder, "run", "system.toml", "--set", "components.a.isolation=process")
    assert len(isolated - {os.getpid()}) == len(isolated) == 1
