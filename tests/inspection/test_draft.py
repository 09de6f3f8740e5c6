"""Whole system files for foreign FMUs: one in the place of the plant, and some alone."""

from comparison.made import write_fmu
from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.draft import alone, replacing

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
    draft = replacing(system, "plant", tmp_path / "vendor.fmu", "here/vendor.fmu", asked)
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
    text, notes = alone(paths)
    assert notes == ["no FMU recommends a stop time: chosen, step = 0.001 s, stop = 1 s"]
    kept = [line for line in text.splitlines() if not line.startswith("# p") or line[3:5] == "10"]
    assert kept == snapshot


def test_the_times_of_fmus_alone(tmp_path):
    """The shortest step, the longest span, and a whole number of steps."""

    def times(*experiments):
        fmus = {}
        for i, attributes in enumerate(experiments):
            write_fmu(path := tmp_path / f"{i}.fmu", {}, {}, step=f'0.3" {attributes} x="')
            fmus[f"c{i}"] = (path, path.name)
        text, notes = alone(fmus)
        entries = (line.partition("  #")[0] for line in text.splitlines())
        keys = ("step", "stop", "start")
        return [line for line in entries if line.partition(" = ")[0] in keys], notes

    span = 'startTime="1" stopTime="4"'
    assert times(span) == (["step = 0.3", "stop = 4.0", "start = 1.0"], [])
    assert times(span, 'stopTime="5"') == (
        ["step = 0.3", "stop = 5.1"],
        [
            "c0: its default experiment begins at 1 s, the run at 0 s",
            "stop = 5 s: 5.1 s is a whole number of steps",
        ],
    )
