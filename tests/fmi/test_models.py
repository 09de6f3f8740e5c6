"""The test models of tests/support/models are FMUs as FMPy has it, with the right values."""

import sys
from math import exp

import fmpy
import pytest
from fmpy.validation import validate_fmu
from grasp_cosim.cli import main
from support.native_fmus import KINDS, MODELS, build_model, needs_cvode, needs_gcc

pytestmark = needs_gcc
VERSIONS = ("2.0", "3.0")
SOLVING = ("grasp_cosim.fmi.cvode", "grasp_cosim.fmi.model_exchange")


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", MODELS)
def test_is_valid(name, version, tmp_path):
    assert validate_fmu(str(build_model(name, tmp_path, version))) == []


@pytest.mark.slow
@needs_cvode
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("version", VERSIONS)
def test_either_kind_alone_runs_in_fmpy(version, kind, tmp_path):
    fmu = build_model("dahlquist", tmp_path, version, [kind])
    run = fmpy.simulate_fmu(str(fmu), stop_time=1.0, relative_tolerance=1e-9)
    assert run["x"][-1] == pytest.approx(exp(-1.0), rel=1e-7)


def test_without_cvode_it_is_refused_by_name(tmp_path, monkeypatch, capsys):
    """FMPy has it for x86-64 Linux and Windows, and for Apple's ARM."""
    monkeypatch.setattr(fmpy, "platform_tuple", "riscv64-linux")
    for module in [m for m in sys.modules if m.startswith("fmpy.sundials") or m in SOLVING]:
        monkeypatch.delitem(sys.modules, module)
        package, _, name = module.rpartition(".")
        if package in sys.modules:
            monkeypatch.delattr(sys.modules[package], name, raising=False)
    build_model("dahlquist", tmp_path, "2.0", ["ModelExchange"])
    path = tmp_path / "system.toml"
    part = '[components.part]\nfmu = "dahlquist.fmu"\nvalues = { u = 0.0 }\n'
    path.write_text(f"[experiment]\nstep = 0.1\nstop = 1.0\n{part}", "utf-8")
    assert main(["run", str(path)]) == 2
    said = capsys.readouterr()
    *_, line = said.err.splitlines()
    begin = "grasp-cosim: part: dahlquist.fmu is for model exchange, and FMPy has no CVode for "
    assert line.startswith(f"{begin}this machine: ")
    assert line.endswith("; must be a co-simulation FMU")
    assert said.out == ""
