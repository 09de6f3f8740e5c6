"""Qualifications with C FMUs: other units, FMI 3.0, another name, a crash, a rejected step."""

import pytest
from grasp_cosim import System
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.comparison.words import qualification_text as as_text
from support.marks import slow
from support.native_fmus import build, needs_gcc

pytestmark = needs_gcc

UNITS = {"x": "m", "gain": "m"}


@pytest.fixture
def loop(tmp_path):
    """x' = gain·(1 - x), one step of 0.01 s after the other: x = 1 - 0.97^k."""
    build(tmp_path, "plant", "2.0", UNITS)
    build(tmp_path, "spring", "2.0", {"u_Real": "m"})
    inputs = ", ".join(
        f"{name} = {value}"
        for name, value in (
            ("u_Integer", "0"), ("u_Boolean", "false"), ("u_Enumeration", "1"), ("u_String", '"a"'),
        )
    )  # fmt: skip
    (tmp_path / "loop.toml").write_text(
        "connections = [\n"
        '  "plant.x -> spring.u_Real",\n'
        '  { from = "spring.y_Real", to = "plant.u_Real", factor = -1.0, offset = 1.0 },\n]\n'
        "[experiment]\nstep = 0.01\nstop = 1.0\n"
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ gain = 3.0, {inputs} }}\n'
        f'[components.spring]\nfmu = "spring.fmu"\nvalues = {{ {inputs} }}\n'
    )
    return System.load(tmp_path / "loop.toml")


def test_the_loop_is_what_it_says(loop, tmp_path):
    found = qualify(loop, "plant", tmp_path / "plant.fmu")
    assert found.qualified
    assert found.swap.differences == ()
    assert {c.deviation for c in found.signals} == {0.0}
    assert found.metrics == ()
    x = found.runs[0]["plant.x"].values
    assert x.tolist() == pytest.approx([1.0 - 0.97**k for k in range(101)], rel=1e-9)


def test_millimetres_are_converted_on_the_connection_in_values_and_in_signals(loop, tmp_path):
    """With its gain in mm, the candidate integrates to x in mm."""
    candidate = build(tmp_path, "millimetres", "2.0", {"x": "mm", "gain": "mm"})
    found = qualify(loop, "plant", candidate, isolation="none")
    assert [(d.severity, d.kind, d.variable, d.text) for d in found.swap.differences] == [
        ("warns", "unit", "gain", "unit mm instead of m: 3 m becomes 3000 mm"),
        ("warns", "unit", "x", "unit mm instead of m: converted"),
    ]
    assert found.qualified
    x, other = (run["plant.x"].values for run in found.runs)
    assert other.tolist() == pytest.approx(x.tolist(), rel=1e-12)
    assert {c.unit for c in found.signals if c.name == "plant.x"} == {"m"}


def test_a_unit_that_is_only_called_another_is_not_the_same_plant(loop, tmp_path):
    candidate = build(tmp_path, "millimetres", "2.0", {"x": "mm", "gain": "m"})
    found = qualify(loop, "plant", candidate, isolation="none")
    assert not found.qualified
    assert {"plant.x", "spring.y_Real"} <= {c.name for c in found.outside}
    assert found.runs[1]["plant.x"].values[1] == pytest.approx(0.03e-3, rel=1e-12)


def test_a_unit_that_cannot_be_converted_blocks(loop, tmp_path):
    candidate = build(tmp_path, "kelvin", "2.0", {"x": "K", "gain": "m"})
    found = qualify(loop, "plant", candidate)
    assert not found.qualified
    assert [(d.variable, d.text) for d in found.blocks] == [
        ("x", "is in K, which cannot be converted to m")
    ]


def test_a_candidate_of_fmi_3_under_other_names(loop, tmp_path):
    candidate = build(tmp_path, "three", "3.0", UNITS)
    rename = {"u_Real": "u_Float64", "y_Real": "y_Float64", "u_Integer": "u_Int32"}
    rename["y_Integer"] = "y_Int32"
    new = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64")
    values = {f"plant.u_{t}": 0 for t in new}
    found = qualify(loop, "plant", candidate, rename=rename, values=values)
    assert found.blocks == ()
    assert found.failure is None
    assert found.qualified
    kinds = {d.kind for d in found.swap.differences}
    assert {"capability", "extra"} <= kinds
    assert "type" not in kinds  # Float64 is Real, Int32 is Integer


def going_wrong(loop, folder, what, isolation):
    """A candidate with a misfortune at 0.505 s, which it takes for its gain."""
    candidate = build(folder, "candidate", "2.0", {"x": "m", what: "m"})
    system = loop.with_values({"plant.gain": 0.505})
    rename = {"gain": what, what: "gain"}
    return qualify(system, "plant", candidate, rename=rename, isolation=isolation)


@pytest.mark.parametrize(
    ("what", "text"),
    [("crash_at", "SIGSEGV"), slow("exit_at", "exit"), slow("error_at", "lamp is broken")],
)
def test_a_candidate_that_ends_on_the_way(loop, tmp_path, what, text):
    """Not even a crash leaves the candidate's process: what it did until then is compared."""
    found = going_wrong(loop, tmp_path, what, "process")
    assert not found.qualified
    assert found.failure is not None
    assert text in found.failure
    assert found.runs[1]["plant.x"].time[-1] == pytest.approx(0.5)
    assert found.runs[0]["plant.x"].time[-1] == pytest.approx(1.0)
    assert all(c.time is not None and c.time <= 0.5 for c in found.signals)
    assert as_text(found).splitlines()[1].startswith("the candidate failed: plant: ")


def test_a_step_that_the_candidate_rejects_is_told(loop, tmp_path):
    found = going_wrong(loop, tmp_path, "discard_at", "none")
    assert not found.qualified
    assert any("discard" in line or "reject" in line for line in (*found.log, found.failure or ""))
