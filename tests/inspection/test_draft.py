"""System files for foreign FMUs, and which of their variables are meant by those of ours."""

from pathlib import Path

import pytest
from comparison.made import write_fmu
from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.draft import draft_of, system_of_fmus
from grasp_cosim.inspection.name_matching import candidates, match_variables
from grasp_cosim.interface.interface import Interface
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.variables import Variable


@pytest.fixture(scope="module")
def plant(fmus):
    return read_interface(fmus / "GripperPlant.fmu")


def output(name, unit=None, kind="Real"):
    return Variable(name, kind, "output", 0, unit, None, None, None)


def settable(name, causality, unit=None):
    return Variable(name, "Real", causality, 0, unit, "0", None, None)


def foreign(*variables):
    return Interface(Path("vendor.fmu"), "", "vendor", variables)


def names(plant, *variables, certain=None):
    return {
        name: match.variable.name
        for name, match in match_variables(plant, foreign(*variables)).items()
        if certain in (None, not match.doubt)
    }


@pytest.mark.parametrize(
    ("pair", "doubt"),
    [
        (("GapRight", "GapLeft"), ""),
        (("fingerGap1", "fingerGap2"), ""),
        (("Gripper.Fingers[1].gap", "Gripper.Fingers[2].gap"), ""),
        (("Gaps[1]", "Gaps[2]"), ""),
        (("plant.l_1", "plant.l_2"), ""),
        (("finger.r.distance", "finger.l.distance"), ""),
        (("GAP_RH", "GAP_LH"), ""),
        (("gap[0]", "gap[1]"), "which is 1, which 2"),
        (("gapA", "gapB"), "which is 1, which 2"),
        (("distanceToWall1", "distanceToWall2"), "by its name"),
    ],
)
def test_names_of_the_gaps(plant, pair, doubt):
    """In any order of declaration, beside positions in the same unit."""
    gaps = [output(name, "mm") for name in pair]
    others = [output(f"fingertip_x_{side}", "mm") for side in ("right", "left")]
    chosen = match_variables(plant, foreign(*gaps[::-1], *others))
    assert {n: (m.variable.name, m.doubt) for n, m in chosen.items()} == {
        "gap[1]": (pair[0], doubt),
        "gap[2]": (pair[1], doubt),
        "position[1]": ("fingertip_x_right", ""),
        "position[2]": ("fingertip_x_left", ""),
    }


def test_unit_type_and_causality_decide(plant):
    """One name, two quantities; and none for what is of another quantity or direction."""
    assert names(plant, output("gap1", "N"), output("gap2", "N")) == {}
    assert names(plant, output("rate1", "mm/s"), output("rate2", "mm/s")) == {}
    assert names(plant, output("gap1", "m", "Boolean"), output("gap2", "m", "Boolean")) == {}
    assert names(plant, settable("gap1", "input", "m"), settable("gap2", "input", "m")) == {}
    forces = [settable("F1", "input", "kN"), settable("F2", "input", "kN")]
    loads = [output("F_c1", "kN"), output("F_c2", "kN")]
    touches = [output(f"inContact{j}", kind="Boolean") for j in (1, 2)]
    assert names(plant, *forces, *loads, *touches, certain=True) == {
        "force[1]": "F1", "force[2]": "F2",
        "contact_force[1]": "F_c1", "contact_force[2]": "F_c2",
        "contact[1]": "inContact1", "contact[2]": "inContact2",
    }  # fmt: skip


def test_parameters(plant):
    start = settable("W", "parameter", "m")
    assert names(plant, start) == {"object_width": "W"}
    assert names(plant, start, certain=True) == {}
    initial = settable("initial_part_pos", "parameter", "cm")
    assert names(plant, initial, certain=True) == {"initial_object_position": "initial_part_pos"}


def test_no_force_is_proposed_for_a_position(plant):
    theirs = foreign(*(output(name) for name in ("F_1", "F_2", "contactForce", "way", "x_1")))
    assert [v.name for v in candidates(plant, "position[1]", theirs, [])] == ["way", "x_1"]
    assert not {"position[1]", "position[2]"} & match_variables(plant, theirs).keys()


@pytest.mark.parametrize(
    ("theirs", "others"),
    [
        ("position[{}]", "finger_position[{}]"),  # of which `finger` says nothing
        ("Position{}", "x_{}"),
        ("position_{}", "Plant.Pos.{}"),
    ],
)
def test_the_very_name_and_the_same_words_go_before_others_of_the_same_meaning(
    plant, theirs, others
):
    outputs = [output(name.format(j), "m") for j in (1, 2) for name in (others, theirs)]
    assert names(plant, *outputs, certain=True) == {
        f"position[{j}]": theirs.format(j) for j in (1, 2)
    }


def test_three_fingers_are_not_those_of_two(plant):
    assert names(plant, *(output(f"position{j}", "m") for j in (1, 2, 3))) == {}


SOME = 'causality="parameter" variability="fixed" | '
VENDOR = {
    "ForceRight": 'causality="input" | Real start="0" unit="N"',
    "ForceLeft": 'causality="input" | Real start="0" unit="N"',
    "the &quot;valve&quot;": 'causality="input" | Real start="0.5" unit="1"',
    "on": 'causality="input" variability="discrete" | Boolean',
    "GapA": 'causality="output" | Real unit="mm"',
    "GapB": 'causality="output" | Real unit="mm"',
    "x_1": 'causality="output" | Real unit="furlong"',
    "x_2": 'causality="output" | Real unit="furlong"',
    "way": 'causality="output" | Real',
    "Hit": 'causality="output" variability="discrete" | Integer',
    "obj_width": SOME + 'Real start="1" unit="mm"',
    "friction_coulomb_1": SOME + 'Real start="0" unit="mN"',
    "friction_viscous_1": SOME + 'Real start="0"',
    "friction_viscous_2": SOME + 'Real start="0"',
    "label": SOME + 'String start="a"',
}


def test_a_foreign_plant(fmus, tmp_path, snapshot):
    write_fmu(tmp_path / "vendor.fmu", VENDOR, {})
    system = System.load(SYSTEM, fmus).with_values({"plant.object_width": 0.06})
    asked = ("friction.coulomb[1]", "friction.viscous[1]", "friction.viscous[2]")
    draft = draft_of(system, "plant", tmp_path / "vendor.fmu", "here/vendor.fmu", asked)
    lines = [f'"plant.{name}" = 1.5  # a comment' for name in ("object_width", *asked)]
    text = draft.put_into("\n".join(["[presets.bench]", *lines]))
    assert draft.text == snapshot
    assert text == snapshot
    assert draft.put_into("a\n\n[components.plant]\nfmu = 1\n\nb") == f"a\n\n{draft.text}\n\nb"


def test_fmus_alone(tmp_path, snapshot):
    many = {f"p{i}": SOME + 'Real start="1"' for i in range(101)}
    write_fmu(tmp_path / "a.fmu", VENDOR, {})
    write_fmu(tmp_path / "b.fmu", {**many, "y": 'causality="output" | Real'}, {}, step="0")
    paths = {"first": (tmp_path / "a.fmu", "a.fmu"), "second": (tmp_path / "b.fmu", "b.fmu")}
    text, notes = system_of_fmus(paths)
    assert notes == ["no FMU recommends a stop time: chosen, step = 0.001 s, stop = 1 s"]
    kept = [line for line in text.splitlines() if not line.startswith("# p") or line[3:5] == "10"]
    assert kept == snapshot


def test_the_times_of_fmus_alone(tmp_path):
    """The shortest step, all that is recommended, and a whole number of steps."""

    def times(*experiments):
        fmus = {}
        for i, attributes in enumerate(experiments):
            write_fmu(path := tmp_path / f"{i}.fmu", {}, {}, step=f'0.3" {attributes} x="')
            fmus[f"c{i}"] = (path, path.name)
        text, notes = system_of_fmus(fmus)
        entries = (line.partition("  #")[0] for line in text.splitlines())
        keys = ("step", "stop", "start")
        return [line for line in entries if line.partition(" = ")[0] in keys], notes

    span = 'startTime="1" stopTime="4"'
    assert times(span) == (["step = 0.3", "stop = 4.0", "start = 1.0"], [])
    assert times(span, 'stopTime="5"') == (["step = 0.3", "stop = 5.1"], [])
    _, (note,) = times('startTime="1" stopTime="1e300"')
    assert note == "no FMU recommends a stop time: chosen, step = 0.3 s, stop = 1.9 s"
