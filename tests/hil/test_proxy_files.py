"""What is made for an FMU on a bench goes to a file of its own, or it is said why it does not."""

import pytest
from comparison.made import write_fmu
from grasp_cosim import InputError, SimulationError
from grasp_cosim.base.c_compilers import CompilerError
from grasp_cosim.fmu_export.proxy import Settings
from grasp_cosim.hil.proxy_of_fmu import write_peer_header, write_proxy

VARIABLES = {
    "u": 'causality="input" | Real start="0" unit="m"',
    "y": 'causality="output" | Real unit="N"',
}


@pytest.fixture
def fmu(tmp_path):
    return write_fmu(tmp_path / "made.fmu", VARIABLES, {})


@pytest.mark.parametrize("name", ["a.h", "made.fmu.h", "z.h"])
def test_any_other_file_takes_the_header(fmu, name):
    write_peer_header(fmu, fmu.with_name(name), {}, "")
    assert "u" in fmu.with_name(name).read_text("utf-8")


def test_the_original_is_not_written_over(fmu):
    content = fmu.read_bytes()
    for out in (fmu, fmu.parent / ".." / fmu.parent.name / fmu.name):
        with pytest.raises(InputError, match=r"made\.fmu: is the original; must be another file$"):
            write_peer_header(fmu, out, {}, "")
        with pytest.raises(InputError, match="is the original"):
            write_proxy(fmu, out, Settings())
    assert fmu.read_bytes() == content


@pytest.mark.parametrize(
    ("error", "raised", "said"),
    [
        (CompilerError("gcc: no memory"), SimulationError, "^gcc: no memory$"),
        (ValueError("port = 0: must be from 1"), InputError, "^proxy: port = 0: must be from 1$"),
    ],
)
def test_what_keeps_it_from_being_built_is_said(fmu, monkeypatch, error, raised, said):
    def fail(*_):
        raise error

    monkeypatch.setattr("grasp_cosim.fmu_export.proxy.build_proxy", fail)
    with pytest.raises(raised, match=said):
        write_proxy(fmu, fmu.with_name("proxy.fmu"), Settings())
