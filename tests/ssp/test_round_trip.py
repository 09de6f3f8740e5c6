"""A system written and read again is the same system, and runs the same to the bit."""

import json
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, Realtime, System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.parts import (
    Acceptance,
    Component,
    Condition,
    Connection,
    Event,
    Fault,
    Initialisation,
    MetricLimit,
    Port,
)
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    described,
    entries_of,
    fmu,
    parameter_set,
    structure,
    system,
)
from support.native_fmus import needs_gcc, talker
from support.native_systems import driven

FORK = "child = os.fork(); child or sys.exit(); os.waitpid(child, 0)"


def round_trip(original, folder):
    """The system as it comes back, with the paths and the name of the original."""
    path = folder / "again.ssp"
    write_ssp(original, path)
    loaded = System.load(path)
    for before, after in zip(original.components, loaded.components, strict=True):
        assert after.fmu.read_bytes() == before.fmu.read_bytes()
        assert list(after.values) == list(before.values)  # the order in which they are set
    paths = {c.name: c.fmu for c in original.components}
    components = tuple(replace(c, fmu=paths[c.name]) for c in loaded.components)
    return replace(loaded, name=original.name, components=components)


def test_the_grasp_runs_the_same_to_the_bit(grasp, tmp_path):
    changed = grasp.with_values({"plant.initial_object_position": 0.02}).with_experiment(1e-3)
    path = tmp_path / "grasp.ssp"
    write_ssp(changed, path)
    ours, again = simulate(changed), simulate(System.load(path))
    assert list(again) == list(ours)
    assert np.array_equal(again.time, ours.time)
    for name in ours:
        assert again[name].tobytes() == ours[name].tobytes(), name


@needs_gcc
def test_what_drives_inputs_comes_back_with_its_values(tmp_path):
    text = "time,a.u_Real [kN],a.u_Enumeration\n0,0,one\n0.3,1e-3,two\n\n0.3,0.1,two\n"
    original = System.load(driven(tmp_path, text, more='[input]\nfile = "drive.csv"\n'))
    (tmp_path / "drive.csv").unlink()
    again = round_trip(original, tmp_path)
    assert again == original
    assert again.input is not None
    assert again.input.place(Port("a", "u_Real"), 2).startswith("drive.csv: line 5")
    ours, theirs = simulate(original), simulate(System.load(tmp_path / "again.ssp"))
    assert all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)
    assert ours["a.y_Real"].tolist()[-1] == 100.0


def test_what_ssp_has_no_form_for_comes_back(grasp, tmp_path):
    plant, *others = grasp.components
    gap, contact = Port("plant", "gap[1]"), Port("plant", "contact[1]")
    full = replace(
        grasp,
        components=(replace(plant, step_ns=300_000, isolation="process", logging=True), *others),
        scheme="jacobi",
        initialisation=Initialisation("refuse", 1e-8, 7),
        realtime=Realtime(0.5, "stop", priority=80),
        events=(
            Event({Port("sensor_1", "reflectance"): 0.5}, at_ns=1_000_000),
            Event({Port("controller", "simultaneous_contact.enabled"): False}, at_ns=2_000_000),
            Event({Port("sensor_2", "reflectance"): 0.1}, when=Condition(gap, "<", 0.01)),
            Event({Port("sensor_2", "reflectance"): 1}, when=Condition(contact, "!=", False)),
        ),
        faults=(
            Fault(Port("sensor_1", "gap"), "bias", {"value": 0.001}, 5, None, seed=3),
            Fault(Port("sensor_2", "gap"), "stuck", {}, 0, 1_000_000_000),
            Fault(Port("sensor_2", "gap"), "delay", {"time": 1e-3}, when=Condition(gap, ">", 0.0)),
        ),
        roles={"hand": "plant"},
        presets={"wide": {"plant.object_width": 0.08}, "loud": {"sensor_1.noise.seed": 3}},
        verdict=Acceptance(lost=1, metrics=(MetricLimit("time_difference", None, 0.05),)),
    )
    assert round_trip(full, tmp_path) == full


@needs_gcc
def test_what_an_fmu_is_asked_to_log_comes_back(tmp_path):
    asked = ("logEvents", "logStatusError")
    parts = (Component("a", talker(tmp_path), {}, logging=asked),)
    original = System("talk.toml", parts, (), 1_000_000, 1_000_000_000, "sequential")
    assert round_trip(original, tmp_path) == original


def hand(folder, *connections, rename=False):
    """Two FMUs with an output y in m and an input u in mm, beside other variables."""
    variables = (
        "output Real y - m",
        "input Real u 0.0 mm",
        "input Integer n 3",
        "output Enumeration mode -",
        "parameter Enumeration start 1",
        "parameter Boolean active false",
        "parameter String label none",
        "parameter Real plain 1.0",
    )
    path = described(folder / "hand.fmu", fmu(*variables))
    names = {"in put": "u", "out": "y", "text": "label"} if rename else {}
    label = "text" if rename else "label"
    values = {
        "n": -4,
        "start": 2,
        "active": True,
        label: 'a "<b>" & ü',
        "plain": 0.1 + 0.2,
    }
    target = "in put" if rename else "u"
    free = [name for name in ("a", "b") if name not in {w.target.component for w in connections}]
    components = tuple(
        Component(name, path, {**values, **({target: 1.5} if name in free else {})}, names)
        for name in ("b", "a")
    )
    return System("hand.toml", components, connections, 1_000_000, 1_000_000_000, "sequential")


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((3.0, 0.25), (3.0, 0.25)),
        ((1.0, 0.0), (1.0, 0.0)),
        ((None, None), (1000.0, 0.0)),  # m to mm, said for masters that know no units
    ],
)
def test_connections_with_a_factor(tmp_path, given, expected):
    connection = Connection(Port("a", "y"), Port("b", "u"), *given)
    (again,) = round_trip(hand(tmp_path, connection), tmp_path).connections
    assert again == Connection(connection.source, connection.target, *expected)


def test_the_texts_of_an_archive(tmp_path, snapshot):
    """Valid by the schema, as reading it shows; under the names of the FMU, an item by its name.

    OSP and OMSimulator find the step where their sources look for it: ssp_parser.cpp of libcosim,
    Model.cpp and SystemWC.cpp of OMSimulator, which wants names that are identifiers, too.
    """
    connection = Connection(Port("a", "out"), Port("b", "in put"), 2.0, 0.25)
    plain = hand(tmp_path, connection, rename=True)
    taken, given = plain.components
    parts = (replace(taken, step_ns=2_000_000), replace(given, units={"out": "cm", "plain": "rad"}))
    original = replace(plain, name="2nd-hand.toml", components=parts)
    again = round_trip(original, tmp_path)
    assert again == original
    written = write_ssp(original, tmp_path / "again.ssp")
    with zipfile.ZipFile(tmp_path / "again.ssp") as file:
        assert file.testzip() is None
        assert file.namelist() == list(written.entries)
        assert {(e.create_system, e.external_attr >> 16) for e in file.infolist()} == {(3, 0o644)}
        texts = {name: file.read(name).decode() for name in written.entries if name[-3:] != "fmu"}
    tool = f"grasp-cosim {version('grasp-cosim')}"
    assert {name: text.replace(tool, "TOOL") for name, text in texts.items()} == snapshot
    assert written.notes[:3] == snapshot
    before = (tmp_path / "again.ssp").read_bytes()
    write_ssp(original, tmp_path / "again.ssp")
    assert (tmp_path / "again.ssp").read_bytes() == before


@pytest.mark.parametrize("between", ["t = System.load(sys.argv[1]); assert s == t", FORK])
def test_extracted_fmus_are_there_until_the_process_ends(between, grasp, tmp_path):
    """Not until a fork of it does."""
    write_ssp(grasp, tmp_path / "grasp.ssp")
    program = (
        "import os, sys; from grasp_cosim import System; s = System.load(sys.argv[1]); "
        f"{between}; print(s.components[0].fmu.exists(), s.components[0].fmu)"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "grasp.ssp")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    existed, _, path = done.stdout.rstrip("\n").partition(" ")
    assert existed == "True"
    assert not Path(path).parents[1].exists()


def test_fmus_of_the_same_name_do_not_collide(grasp, tmp_path):
    other = tmp_path / "GripperPlant.fmu"
    other.write_bytes(grasp.components[1].fmu.read_bytes())  # a sensor under the plant's name
    mixed = replace(
        grasp,
        components=tuple(
            replace(c, fmu=other) if c.name == "sensor_1" else c for c in grasp.components
        ),
    )
    assert round_trip(mixed, tmp_path) == mixed


def test_one_name_for_two_units_is_written_for_the_first_only(tmp_path):
    original = hand(tmp_path)
    description = fmu("output Real y - mm", "input Real u 0.0 mm").replace(b'"0.001"', b'"0.3048"')
    path = described(tmp_path / "feet.fmu", description)
    other = Component("c", path, {"u": 1.0})
    mixed = replace(original, components=(*original.components, other))
    assert round_trip(mixed, tmp_path) == mixed


def test_a_whole_number_that_ssp_does_not_hold_is_refused(tmp_path):
    description = b"""<fmiModelDescription fmiVersion="3.0" modelName="w" instantiationToken="{}">
      <CoSimulation modelIdentifier="w"/><ModelVariables><Int64 name="n" valueReference="1"
      causality="parameter" variability="fixed" start="1"/><Binary name="b" valueReference="2"
      causality="output"/></ModelVariables><ModelStructure><Output valueReference="2"/>
      </ModelStructure>
      </fmiModelDescription>"""
    path = described(tmp_path / "wide.fmu", description)
    parts = (Component("c", path, {"n": 2**31}),)
    wide = System("wide.toml", parts, (), 1_000_000, 1_000_000_000, "sequential")
    with pytest.raises(InputError, match=r"c\.n = 2147483648: must fit into 32 bits"):
        write_ssp(wide, tmp_path / "wide.ssp")
    narrow = wide.with_values({"c.n": 2**31 - 1})
    assert round_trip(narrow, tmp_path) == narrow
    notes = write_ssp(narrow, tmp_path / "narrow.ssp").notes
    assert notes[-1] == "c.b is of type Binary: it has no connector"


def filters(folder):
    """An FMU of FMI 3.0 with arrays of n = 2 elements or more, in m, and a matrix."""
    description = b"""<fmiModelDescription fmiVersion="3.0" modelName="f" instantiationToken="{}">
      <CoSimulation modelIdentifier="f"/><UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit>
      </UnitDefinitions><ModelVariables>
      <UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed"
      start="2"/>
      <Float64 name="Ins" valueReference="2" causality="input" unit="m" start="0.0">
      <Dimension valueReference="1"/></Float64>
      <Float64 name="Outs" valueReference="3" causality="output" unit="m">
      <Dimension valueReference="1"/></Float64>
      <Float64 name="A" valueReference="4" causality="parameter" variability="fixed" start="1.0">
      <Dimension start="2"/><Dimension start="2"/></Float64>
      </ModelVariables><ModelStructure><Output valueReference="3"/></ModelStructure>
      </fmiModelDescription>"""
    return described(folder / "filters.fmu", description)


def test_arrays_of_a_given_size_come_back(tmp_path):
    """Under other names, whole or by elements, with units, values and connections of elements."""
    path = filters(tmp_path)
    first = Component(
        "a", path, {"n": 3, "in[3]": 5.0, "A[1,2]": 7.0}, {"in": "Ins", "out": "Outs"}
    )
    second = Component(
        "b", path, {"n": 3}, {"y": "Outs[1]", "u": "Ins"}, units={"u": "mm", "y": "cm"}
    )
    ports = [(f"out[{i}]", f"u[{i}]") for i in (1, 2, 3)]
    connections = tuple(
        Connection(Port("a", start), Port("b", end), 1000.0, 0.0) for start, end in ports
    )
    values = {"in[1]": 0.0, "in[2]": 0.0, **first.values}
    whole = System(
        "f.toml",
        (replace(first, values=values), second),
        connections,
        1_000_000,
        1_000_000_000,
        "sequential",
    )
    again = round_trip(whole, tmp_path)
    assert again == whole
    notes = write_ssp(whole, tmp_path / "f.ssp").notes
    said = "SSP 1.0 has no arrays: in, out, A by elements, which other tools do not know"
    assert f"a: {said}" in notes
    text = entries_of(tmp_path / "again.ssp")["SystemStructure.ssd"].decode()
    assert 'startConnector="Outs[3]" endElement="b" endConnector="Ins[3]"' in text


def test_an_archive_of_others_says_how_many_elements_there_are(tmp_path):
    description = entries_of(filters(tmp_path))["modelDescription.xml"]
    given = bind(parameter_set("n Integer 4; Ins[4] Real 2.5", units=""))
    parts = component("a", "output Outs[4] Real m") + component(
        "b", "input Ins[3]; input Ins[4]", given
    )
    four = bind(parameter_set("a.n Integer 4"))
    top = system(
        "top", parts.replace("/a.fmu", "/b.fmu"), connect("a/Outs[4]", "b/Ins[3]"), "", four
    )
    loaded = System.load(archive(tmp_path, structure(top), {"b": description}), step=0.1)
    assert loaded.components[1].values["Ins[4]"] == 2.5
    assert loaded.connections[0].target == Port("b", "Ins[3]")


def test_the_command_writes_an_archive(fmus, tmp_path, command):
    toml, path = tmp_path / "mine.toml", tmp_path / "mine.ssp"
    toml.write_text(SYSTEM.read_text("utf-8"), encoding="utf-8")
    for file in fmus.glob("*.fmu"):
        (tmp_path / file.name).symlink_to(file)
    code, out, err = command("ssp", str(toml), "-o", str(path))
    assert (code, out.splitlines()[0]) == (0, f"{path}: written")
    assert "SSP has no form for the step, 0.0001 s: OSP and OMSimulator read it" in err
    code, out, err = command("ssp", str(toml), "-o", str(path), "--json")
    report = json.loads(out)
    assert (code, err, report["ssp"], report["connections"]) == (0, "", str(path), 10)
    assert report["entries"][0] == "SystemStructure.ssd"
    assert report["components"] == ["plant", "sensor_1", "sensor_2", "controller"]
    assert [note.partition(",")[0] for note in report["notes"]] == [
        "SSP has no form for the step",
        "SSP has no form for the scheme",
    ]
    code, out, err = command("ssp", str(toml), "-o", str(tmp_path / "mine.zip"))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "must be a file named like system.ssp" in err


def test_run_says_what_was_decided(tmp_path, command):
    ssd = structure(system("top", component("a", "output y")))
    path = archive(tmp_path, ssd, {"a": fmu("output Real y -", step="")})
    assert "give one: --set experiment.step" in command("run", str(path))[2]
    code, _, err = command("run", str(path), "--step", "1e-3")  # now it is the FMU that has no code
    assert code == 2
    assert "order of execution: a" in err
    assert "a.fmu has no binary at all" in err


def test_what_is_recorded_comes_back(grasp, tmp_path):
    times = {"before": "1/3", "after": 0.5}
    original = grasp.with_record("plant.*", "!plant.force*", trigger="plant.gap[1] < 0.01", **times)
    again = round_trip(original, tmp_path)
    assert again == original
    assert [*again.recorded] == [*original.recorded]
