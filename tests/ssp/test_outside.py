"""The inputs and outputs of an archive's systems, under their names: driven, set, and recorded."""

import re
from dataclasses import replace

import pytest
from grasp_cosim import InputError, System, metric, simulate, sweep
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.connectors import taps
from grasp_cosim.system.parts import Condition, Event, Port
from ssp.hand_made import (
    UNITS,
    archive,
    bind,
    component,
    connect,
    described,
    fmu,
    linear,
    parameter_set,
    structure,
    system,
)
from support.native_fmus import build, needs_gcc

FOOT = 0.3048
FEET = f'<ssc:Unit name="ft"><ssc:BaseUnit m="1" factor="{FOOT}"/></ssc:Unit>'

PARTS = component(
    "a", "input u_Real Real m; output y_Real Real m; parameter gain Real; input u_String"
) + component("b", "input u_Real Real mm; output y_Real Real mm; output y_String String")
INSIDE = (
    connect("height", "a/u_Real")
    + connect("height", "b/u_Real")
    + connect("gain", "a/gain")
    + connect("b/y_Real", "depth")
)


@metric("deepest", unit="m", needs={"Alt": "m"})
def deepest(run):
    """Of what the archive shows."""
    return run["Alt"].max()


SUB = system(
    "sub", PARTS, INSIDE, "input height Real m; output depth Real mm; parameter gain; input apart"
)
OUTSIDE = (
    connect("Height", "sub/height", linear(2.0, 0.5))
    + connect("sub/depth", "Alt")
    + connect("sub/depth", "Twice", linear(2.0), suppressUnitConversion="true")
)
CONNECTORS = "input Height Real ft; output Alt Real ft; output Twice Real; output loose Real"


def ssd(top):
    return structure(top).replace(UNITS, UNITS + FEET)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Height in ft leads to sub_a in m and sub_b in mm; Alt in ft is what sub_b puts out."""
    folder = tmp_path_factory.mktemp("archive")
    a = build(folder, "a", "2.0", {"u_Real": "m", "y_Real": "m"}).read_bytes()
    b = build(folder, "b", "2.0", {"u_Real": "mm", "y_Real": "mm"}).read_bytes()
    top = system("top", SUB, OUTSIDE, CONNECTORS)
    return archive(folder, ssd(top), {}, {"resources/a.fmu": a, "resources/b.fmu": b})


def height_in_sub(feet):
    """m in the nested system of a Height."""
    return 2.0 * feet * FOOT + 0.5


@pytest.fixture
def load(path):
    return lambda **more: System.load(path, step=0.5, **more)


def test_the_names_that_an_archive_has_outside(load):
    loaded = load()
    assert [*loaded.inputs] == ["Height", "sub.gain"]
    assert [*loaded.outputs] == ["Alt", "Twice", "sub.depth"]
    for said in (
        "loose has no output of a component behind it; not recorded",
        "sub.apart leads to no variable of a component; cannot be given a value",
    ):
        assert any(note.endswith(said) for note in loaded.notes)


@needs_gcc
def test_outputs_are_recorded_besides_those_of_components(load):
    run = simulate(load().with_values({"Height": 10.0}))
    deep = height_in_sub(10.0)
    assert run["sub_a.y_Real"][-1] == pytest.approx(deep, rel=1e-12)
    assert run["sub_b.y_Real"][-1] == pytest.approx(1e3 * deep, rel=1e-12)
    assert run["Alt"] == pytest.approx(run["sub_b.y_Real"] / 1e3 / FOOT, rel=1e-12)
    assert run["Twice"].tolist() == (2.0 * run["sub_b.y_Real"]).tolist()
    assert run["sub.depth"].tolist() == run["sub_b.y_Real"].tolist()
    assert [run.units[name] for name in ("Alt", "Twice", "sub.depth")] == ["ft", None, "mm"]


@needs_gcc
@pytest.mark.parametrize("text", ["Height\n0,0\n1,10", "Height [m]\n0,0\n1,3.048"])
def test_a_column_drives_all_that_an_input_leads_to(load, tmp_path, text):
    (tmp_path / "drive.csv").write_text(f"time,{text}\n")
    loaded = load(input=tmp_path / "drive.csv")
    assert not any("keeps its start value" in note and "Real" in note for note in loaded.notes)
    run = simulate(loaded)
    feet = [0.0, 0.0, 5.0]  # each step by the values at its beginning
    wanted = [height_in_sub(x) for x in feet]
    assert run["sub_a.y_Real"] == pytest.approx(wanted, rel=1e-12)
    assert run["sub_b.y_Real"] == pytest.approx([1e3 * x for x in wanted], rel=1e-12)


def test_a_value_for_what_a_column_drives_is_refused(path, tmp_path, command):
    (tmp_path / "drive.csv").write_text("time,Height\n0,1\n")
    line = ["run", path, "--step", "0.5", "--input", "drive.csv"]
    for place in ("Height", "sub_b.u_Real"):
        code, _, err = command(*line, "--set", f"{place}=1")
        assert code == 2
        assert f"--set {place}: does nothing, as drive.csv drives it" in err


MISTAKES = {
    "height\n0,1": "line 1, column 2, height: no input 'height'; did you mean Height?",
    "Height [K]\n0,1": "column 2, Height [K]: cannot be converted into ft; must be a unit of that",
    "Height\n0,high": "column 2, Height = 'high': must be a number",
    "Height,sub_a.u_Real\n0,1,1": "both drive sub_a.u_Real; must be driven by one",
    "b.x,Height\n0,1,1": "no component 'b'",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_in_a_column_is_one_line(load, tmp_path, text):
    (tmp_path / "drive.csv").write_text(f"time,{text}\n")
    with pytest.raises(InputError, match=re.escape(MISTAKES[text])) as refused:
        load(input=tmp_path / "drive.csv")
    assert "\n" not in str(refused.value)


def test_a_value_goes_to_all_that_an_input_or_parameter_leads_to(load):
    changed = load().with_values({"Height": "1", "sub.gain": 3.0})
    assert changed.start("sub_a.u_Real") == height_in_sub(1.0)
    assert changed.start("sub_b.u_Real") == pytest.approx(1e3 * height_in_sub(1.0), rel=1e-15)
    assert changed.start("sub_a.gain") == 3.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"Height": "high"}, "Height = 'high': must be a number"),
        ({"Height": 1.0, "sub_b.u_Real": 2.0}, "both give sub_b.u_Real a value"),
        ({"Hight": 1.0}, "no key of a system file; did you mean Height?"),
    ],
)
def test_a_mistake_in_a_value_is_one_line(load, values, said):
    with pytest.raises(InputError, match=re.escape(said)):
        load().with_values(values)


@needs_gcc
def test_the_names_are_those_of_metrics_conditions_and_sessions(load):
    event = Event({Port("sub_a", "gain"): 5.0}, when=Condition(Port("", "Alt"), ">", 3.0))
    loaded = load().with_values({"Height": 1.0})

    with simulate.session(replace(loaded, events=(event,)), metrics=[deepest]) as session:
        session.step()
        feet = height_in_sub(1.0) / FOOT
        assert session["Alt"] == pytest.approx(feet, rel=1e-12)
        session.set("Height", 0.0)
        session.step()
        run = session.result()
    assert run["Alt"] == pytest.approx([feet, feet, 0.5 / FOOT], rel=1e-12)
    assert run.metrics["deepest"] == pytest.approx(height_in_sub(1.0), rel=1e-12)
    assert "t = 0 s: sub_a.gain = 5.0 (Alt > 3.0)" in run.log


@needs_gcc
def test_only_those_are_recorded_that_are_named(load):
    run = simulate(load().with_record("Alt", "sub_a.*", "!sub_a.y*"))
    assert "Alt" in run
    assert "sub_a.u_Real" in run
    assert not {"Twice", "sub.depth", "sub_a.y_Real", "sub_b.y_Real"} & {*run}
    with pytest.raises(InputError, match=r"'Alto' matches no signal; did you mean Alt\?"):
        load().with_record("Alto")


@needs_gcc
def test_an_archive_that_is_written_anew_has_them(load, tmp_path):
    loaded = load().with_values({"Height": 10.0})
    write_ssp(loaded, tmp_path / "anew.ssp")
    again = System.load(tmp_path / "anew.ssp")
    before, after = simulate(loaded), simulate(again)
    assert [*after] == [*before]
    assert all(after[name].tolist() == before[name].tolist() for name in before)
    assert after.units == before.units
    changed = simulate(again.with_values({"Height": 1.0}))
    assert changed["Alt"][-1] == pytest.approx(height_in_sub(1.0) / FOOT, rel=1e-12)


@needs_gcc
def test_values_of_each_kind_are_passed_on_and_recorded_as_they_are(tmp_path):
    kinds = ("Boolean", "Enumeration", "Integer", "String")
    drawn = "".join(connect(k, f"a/u_{k}") + connect(f"a/y_{k}", f"{k}_out") for k in kinds)
    listed = "; ".join(f"input {k}; output {k}_out" for k in kinds)
    whole = connect("a/y_Integer", "whole")
    top = system("top", component("a"), drawn + whole, f"{listed}; output whole Real")
    entries = {"resources/a.fmu": build(tmp_path, "a", "2.0").read_bytes()}
    loaded = System.load(archive(tmp_path, structure(top), {}, entries), step=0.5)
    given = {"Boolean": "true", "Enumeration": "two", "Integer": 7, "String": "x"}
    run = simulate(loaded.with_values(given))
    names = [f"{kind}_out" for kind in kinds]
    assert [run[name][-1] for name in (*names, "whole")] == [True, 2, 7, "x", 7.0]
    assert [run[name].dtype.kind for name in (*names, "whole")] == [*"biiO", "f"]


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("values", [[10.0, 20.0], ["3.048 m", "6.096 m"]])
def test_a_sweep_varies_an_input_in_its_unit_or_one_that_is_said(load, values):
    table = sweep(load(), {"Height": values}, metrics=[deepest], workers=1)
    wanted = [height_in_sub(feet) for feet in (10.0, 20.0)]
    assert table["deepest"].tolist() == pytest.approx(wanted, rel=1e-12)


FMU = fmu("input Real u 0.5 m", "output Real y - m", "parameter Real k 1.0", "output Boolean on -")


def outside(tmp_path, connectors, connections, bindings="", parts="a"):
    elements = "".join(map(component, parts))
    top = system("top", elements, connections, connectors, bindings)
    return System.load(archive(tmp_path, structure(top), dict.fromkeys(parts, FMU)))


def test_a_value_of_a_set_for_an_input_is_that_of_what_it_leads_to(tmp_path):
    given = bind(parameter_set("In Real 250 mm"))
    loaded = outside(tmp_path, "input In Real mm", connect("In", "a/u"), given)
    assert loaded.start("a.u") == 0.25
    assert loaded.with_values({"In": 500.0}).start("a.u") == 0.5


def test_what_has_the_name_of_something_else_is_left_out(tmp_path):
    drawn = connect("a/y", "a.y") + connect("a/y", "Time") + connect("a/y", "y")
    loaded = outside(tmp_path, "output a.y; output Time; output y", drawn)
    assert [*loaded.outputs] == ["y"]
    for name in ("a.y", "Time"):
        said = f"'{name}' is the name of something else; left out"
        assert any(note.endswith(said) for note in loaded.notes)


def test_an_output_that_cannot_be_followed_is_left_out(tmp_path):
    """The archive runs all the same."""
    drawn = connect("a/on", "Force", linear(2.0)) + connect("a/y", "Warm") + connect("In", "Out")
    listed = "output Force Boolean; output Warm Real K; input In; output Out"
    loaded = outside(tmp_path, listed, drawn)
    assert not loaded.outputs
    assert not loaded.inputs
    assert any("Warm is not recorded: " in note for note in loaded.notes)
    assert any("Force is not recorded: " in note for note in loaded.notes)


def test_another_fmu_behind_an_output_is_converted(tmp_path):
    """Where the units decide; where the archive gives a factor, it is meant in the former unit."""
    other = described(tmp_path / "other.fmu", FMU.replace(b'unit="m"', b'unit="mm"'))
    loaded = outside(tmp_path, "output Out Real m", connect("a/y", "Out")).swap("a", other)
    assert taps(loaded)["Out"].change == (0.001, 0.0)
    drawn = connect("a/y", "Out", linear(3.0))
    with pytest.raises(InputError, match=r"y is in mm, but .* is meant in m; must be in that"):
        outside(tmp_path, "output Out Real m", drawn).swap("a", other)
