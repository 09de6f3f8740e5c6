"""init: a system file that runs as it is, or that says what is left to do."""

import json
import re
import shutil
import sys
from pathlib import Path
from subprocess import run

import pytest
from comparison.made import write_fmu
from grasp_cosim import System
from grasp_cosim.cli.systems import path_from
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.block_templates import BLOCK_TEMPLATES
from support.native_fmus import build_model, needs_gcc

FOREIGN = {
    "ForceRight": 'causality="input" | Real start="0" unit="N"',
    "ForceLeft": 'causality="input" | Real start="0" unit="N"',
    "valve": 'causality="input" | Real start="0.5" unit="1"',
    "GapRight": 'causality="output" | Real unit="mm"',
    "GapLeft": 'causality="output" | Real unit="mm"',
    "x_1": 'causality="output" | Real unit="mm"',
    "x_2": 'causality="output" | Real unit="mm"',
    "v_1": 'causality="output" | Real',
    "v_2": 'causality="output" | Real',
    "place": 'causality="parameter" variability="fixed" | Real start="1" unit="mm"',
}


@pytest.fixture
def fmus_here(command, fmus, tmp_path):
    """The command in a folder in which the FMUs are built."""
    shutil.copytree(fmus, tmp_path / "fmus/build")
    return command


def test_the_grasp(fmus_here, tmp_path):
    code, out, err = fmus_here("init", "my_system.toml")
    assert (code, err) == (0, "")
    assert out == "my_system.toml: written\n    then: grasp-cosim run my_system.toml\n"
    text = (tmp_path / "my_system.toml").read_text("utf-8")
    assert text.replace('"fmus/build/', '"') == SYSTEM.read_text("utf-8")


def test_the_folder_may_be_moved(fmus_here, tmp_path):
    shutil.copytree(tmp_path / "fmus", tmp_path / "here/fmus")
    assert fmus_here("init", "here/my_system.toml")[0] == 0
    shutil.move(tmp_path / "here", tmp_path / "there")
    system = System.load(tmp_path / "there/my_system.toml")
    assert system.component("controller", "test").fmu.name == "GraspController.fmu"
    assert all(c.fmu.is_relative_to(tmp_path / "there") for c in system.components)


def filled_in(path):
    """Put something in the place of each TODO of a plant like FOREIGN."""
    lines = path.read_text("utf-8").splitlines()
    for i, line in enumerate(lines):
        if ' = "TODO' in line:
            value = "0.5" if line.startswith("valve") else '"mm/s"'
            lines[i] = f"{line.partition(' = ')[0]} = {value}"
    path.write_text("\n".join(lines), "utf-8")


FELT = (
    "contact_impulse", "first_contact_time", "impact_velocity", "touched", "impact_impulse",
)  # fmt: skip
"""What our plants tell of a contact that another one may not."""


def test_a_foreign_plant(fmus_here, tmp_path):
    write_fmu(tmp_path / "vendor.fmu", FOREIGN, {})
    code, out, err = fmus_here("init", "a.toml", "--as", "plant=vendor.fmu", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    plant = report["components"]["plant"]
    assert plant["found"]["gap[2]"] == "GapLeft"
    assert plant["units"]["velocity[1]"] is None
    assert list(plant["to_check"]) == []
    todo = [entry["text"].partition(" = ")[0] for entry in report["todo"]]
    assert todo == ['"velocity[1]"', '"velocity[2]"', "valve"]
    lines = (tmp_path / "a.toml").read_text("utf-8").split("\n")
    assert all(lines[entry["line"] - 1] == entry["text"] for entry in report["todo"])
    notes = [re.split(" =| in the", line)[0] for line in lines if line.startswith("# TODO")]
    assert notes == [
        '# TODO "contact_force[1]"', '# TODO "contact_force[2]"', '# TODO "contact[1]"',
        '# TODO "contact[2]"', "# TODO object_position",
        *(f'# TODO "{name}[{j}]"' for name in FELT for j in (1, 2)), "# TODO object_width",
        "# TODO initial_object_position",
    ]  # fmt: skip
    assert any(line.endswith("not found in the FMU, left out; it has place") for line in lines)
    for command in (("run", "a.toml"), ("qualify", "a.toml", "--as", "plant")):
        code, out, err = fmus_here(*command)
        first = report["todo"][0]
        assert (code, out) == (2, "")
        assert err.startswith(f"grasp-cosim: a.toml: line {first['line']}: {first['text']}: must")
        assert err.endswith(f"as is line {', '.join(str(e['line']) for e in report['todo'][1:])}\n")
    filled_in(tmp_path / "a.toml")
    component = System.load(tmp_path / "a.toml").component("plant", "test")
    assert component.fmu == tmp_path / "vendor.fmu"
    assert (component.isolation, component.values) == ("process", {"valve": 0.5})
    assert component.interface.by_name["velocity[2]"].unit == "mm/s"


def test_values_and_presets_are_in_the_units_of_the_fmu(fmus_here, tmp_path):
    parameter = 'causality="parameter" variability="fixed" | Real start="0"'
    more = {"obj_width": f'{parameter} unit="mm"'}
    for j in (1, 2):
        more[f"friction_coulomb_{j}"] = f'{parameter} unit="N"'
        more[f"friction_viscous_{j}"] = parameter
    write_fmu(tmp_path / "vendor.fmu", {**FOREIGN, **more}, {})
    assert fmus_here("init", "a.toml", "--as", "plant=vendor.fmu")[0] == 0
    lines = (tmp_path / "a.toml").read_text("utf-8").splitlines()
    assert re.findall(r"^object_width = (.*?) +# (.*)$", "\n".join(lines), re.MULTILINE) == [
        ('"obj_width"', "parameter, mm"), ("70.0", "parameter, mm"),
    ]  # fmt: skip
    bench = [line for line in lines if "plant.friction" in line]
    assert bench[1].startswith('"plant.friction.coulomb[2]" = 1.19546')
    assert bench[2].startswith('# "plant.friction.viscous[1]" = 33.3562')
    assert bench[2].endswith("# TODO: in the unit that it has")


def test_an_fmu_that_was_built_here_needs_no_process_of_its_own(fmus_here):
    fmu = "fmus/build/GripperPlantCompliant.fmu"
    assert fmus_here("init", "a.toml", "--as", f"plant={fmu}")[0] == 0
    assert fmus_here("init", "alone.toml", "--fmu", f"plant={fmu}")[0] == 0
    for file in ("a.toml", "alone.toml"):
        assert System.load(file).component("plant", "test").isolation == "none"


@pytest.mark.parametrize("kind", BLOCK_TEMPLATES)
def test_a_block_to_start_from(command, tmp_path, kind):
    """It builds as the command says, and is not written over."""
    code, out, err = command("init", "mine.py", "--template", kind)
    assert (code, err) == (0, "")
    assert out.startswith(
        "mine.py: written\ntest_mine.py: written\n    then: grasp-cosim build mine.py"
    )
    assert command("build", "mine.py")[1] == "fmus/build/Mine.fmu: new\n"
    for left, there in (("mine.py", "test_mine.py"), ("test_mine.py", "mine.py")):
        (tmp_path / left).unlink(missing_ok=True)
        (tmp_path / there).write_text("own")
        code, _, err = command("init", "mine.py", "--template", kind)
        assert (code, err.startswith(f"grasp-cosim: {there}: is there already; ")) == (2, True)
        assert not (tmp_path / left).exists()
        assert (tmp_path / there).read_text() == "own"
    assert command("init", "mine.py", "--template", kind, "--force")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("kind", BLOCK_TEMPLATES)
def test_its_test_passes_as_it_is_written(command, tmp_path, kind):
    assert command("init", "mine.py", "--template", kind)[0] == 0
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py"]
    done = run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    mutant = (tmp_path / "mine.py").read_text("utf-8").replace(" + p.", " - p.")
    (tmp_path / "mine.py").write_text(mutant.replace("d * (u.force", "d * -(u.force"), "utf-8")
    done = run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1, "it has to see that the equations are others"


@pytest.mark.slow
@needs_gcc
def test_fmus_alone(fmus_here, tmp_path):
    build_model("bouncing_ball", tmp_path, "3.0", file="ball")
    build_model("feedthrough", tmp_path, "2.0", file="through")
    fmus = ("--fmu", "ball=ball.fmu", "--fmu", "through=through.fmu")
    assert fmus_here("init", "alone.toml", *fmus)[0] == 0
    system = System.load("alone.toml")
    assert [c.isolation for c in system.components] == ["process", "process"]
    assert (system.step_ns, system.stop_ns) == (10_000_000, 3_000_000_000)
    interface = system.component("through", "test").interface
    inputs = {v.name: v.start_value for v in interface.of("input") if v.supported}
    assert system.component("through", "test").values == inputs
    text = (tmp_path / "alone.toml").read_text("utf-8")
    assert "# g = -9.81  # parameter" in text
    name = next(v.name for v in interface.of("input") if v.kind == "Real")
    Path("drive.csv").write_text(f"time,through.{name}\n0,1.5\n1,1.5\n", "utf-8")
    code, out, err = fmus_here("run", "alone.toml", "--input", "drive.csv", "--json")
    assert (code, json.loads(out)["steps"]) == (0, 300)
    assert f"drive.csv drives through.{name}" in err


@needs_gcc
@pytest.mark.parametrize(
    ("step", "line", "steps"),
    [
        ("0.033333333333333333", 'step = "1/30"', 30),
        ("0.0333333333", 'step = "1/30"', 30),
        ("0.0333", "step = 0.0333", 30),
        ("0.0009765625", 'step = "1/1024"', 1024),
    ],
)
def test_the_step_that_an_fmu_recommends(fmus_here, tmp_path, step, line, steps):
    """As it says, never a shorter one; with the next whole number of steps to its stop time."""
    build_model("rigid", tmp_path, kinds=["CoSimulation"], step=step)
    assert fmus_here("init", "rigid.toml", "--fmu", "a=rigid.fmu")[0] == 0
    assert f"\n{line}  # s" in (tmp_path / "rigid.toml").read_text("utf-8")
    assert System.load("rigid.toml").total_steps == steps


def test_paths(tmp_path):
    """Relative below the folder of the file and beside it, else absolute."""
    here = tmp_path / "project/systems"
    assert path_from(here, here / "a.fmu") == "a.fmu"
    assert path_from(here, here / "fmus/a.fmu") == "fmus/a.fmu"
    assert path_from(here, tmp_path / "project/fmus/a.fmu") == "../fmus/a.fmu"
    assert path_from(here, tmp_path / "a.fmu") == str(tmp_path / "a.fmu")


def test_names_that_a_system_file_has_to_quote(fmus_here, tmp_path):
    brake = 'plant.the "brake"'
    others = {"GapRight": "plant.l_1", "GapLeft": "plant.l_2"}
    others["valve"] = brake.replace('"', "&quot;")
    awkward = {others.get(name, name): text for name, text in FOREIGN.items()}
    write_fmu(tmp_path / "é #1.fmu", awkward, {})
    assert fmus_here("init", "a.toml", "--as", "plant=é #1.fmu")[0] == 0
    text = (tmp_path / "a.toml").read_text("utf-8")
    text = re.sub(r'^("velocity.*) = "TODO.*', r'\1 = "mm/s"', text, flags=re.MULTILINE)
    (tmp_path / "a.toml").write_text(re.sub(r'"TODO: 0.5 .*"', "0.25", text), "utf-8")
    plant = System.load(tmp_path / "a.toml").component("plant", "test")
    assert plant.values == {brake: 0.25}
    assert plant.rename["gap[2]"] == "plant.l_2"
