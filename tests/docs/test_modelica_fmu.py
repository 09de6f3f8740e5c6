"""docs/modelica_fmu.py: what it corrects in a description of rumoca, and what it refuses."""

import sys
import types
import zipfile

import pytest
from grasp_cosim.interface.read import describe
from modelica_fmu import main, mended
from support.native_fmus import needs_gcc

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="M" guid="M">
  <CoSimulation modelIdentifier="M"/>

  <LogCategories>
    <Category name="logAll"/>
  </LogCategories>

  <ModelVariables>
<ScalarVariable name="a[1]" valueReference="0" causality="parameter" variability="fixed">
      <Real start="[0.11, (-0.12)]" unit="m"/>
    </ScalarVariable>
<ScalarVariable name="a[2]" valueReference="1" causality="parameter" variability="fixed">
      <Real start="[0.11, (-0.12)]" unit="m"/>
    </ScalarVariable>
<ScalarVariable name="b" valueReference="2" causality="parameter" variability="fixed"
      description="(-1)">
      <Real start="(-2.5e-3)" unit="N"/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure/>
</fmiModelDescription>
"""


def test_starts_and_units_are_as_the_standard_has_them(tmp_path):
    fmu = tmp_path / "m.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr("modelDescription.xml", mended(DESCRIPTION))
    interface = describe(fmu)
    starts = {v.name: (float(v.start), v.unit) for v in interface.variables}
    assert starts == {"a[1]": (0.11, "m"), "a[2]": (-0.12, "m"), "b": (-2.5e-3, "N")}
    assert interface.by_name["b"].description == "(-1)"
    assert mended(DESCRIPTION).count("<UnitDefinitions>") == 1


def test_a_start_per_element_of_an_array_stays():
    """As FMI 3.0 has it, but for the parentheses."""
    text = '<Float64 name="a" valueReference="11" start="0.11 (-0.11)">'
    assert mended(text) == '<Float64 name="a" valueReference="11" start="0.11 -0.11">'


class Failed(Exception):
    """As rumoca raises it."""


class Session:
    """Renders C code as it is written in the file; refuses a model that is not there."""

    def __init__(self, roots):
        pass

    def load(self, path, *, model):
        if model != "M":
            raise Failed(f"{model}\n  is not there")
        return self

    def codegen(self, target):
        assert target == "fmi2"
        code = types.SimpleNamespace(path="sources/M.c", content=Session.code)
        xml = types.SimpleNamespace(path="modelDescription.xml", content=DESCRIPTION)
        return types.SimpleNamespace(files=[xml, code])


@pytest.fixture
def rumoca(monkeypatch, tmp_path):
    """A rumoca that is not one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.mo").write_text("model M end M;", "utf-8")
    fake = types.SimpleNamespace(Session=Session, RumocaError=Failed, version=lambda: "0.9.13")
    monkeypatch.setitem(sys.modules, "rumoca", fake)


@needs_gcc
@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ("m.mo N -o m.fmu", "", "N: rumoca 0.9.13: N is not there"),
        ("n.mo M -o m.fmu", "", "n.mo: no such file; must be a package or a .mo file"),
        ("m.mo M -o m.fmu", "int f(void) { return x; }", "M.c: cc refuses it: "),
        ("m.mo M -o none/m.fmu", "", "[Errno 2] No such file or directory: "),
    ],
)
def test_what_it_refuses_is_one_line(rumoca, words, code, message, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(Session, "code", code, raising=False)
    assert main(words.split()) == 2
    line = capsys.readouterr().err
    assert line.startswith(message)
    assert line.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["m.mo"]


@needs_gcc
def test_the_fmu_has_the_binary_for_this_computer(rumoca, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(Session, "code", "int f(void) { return 0; }", raising=False)
    assert main(["m.mo", "M", "-o", "m.fmu"]) == 0
    assert capsys.readouterr().out == "m.fmu: written, FMI 2.0\n"
    names = {name for name in zipfile.ZipFile("m.fmu").namelist() if not name.endswith("/")}
    assert names == {"modelDescription.xml", "sources/M.c", "binaries/linux64/M.so"}


def test_without_rumoca(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "rumoca", None)
    assert main([str(tmp_path), "M", "-o", "m.fmu"]) == 2
    assert capsys.readouterr().err == "rumoca is not installed: pip install rumoca==0.9.13\n"
