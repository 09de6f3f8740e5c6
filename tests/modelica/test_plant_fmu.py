"""The plant in Modelica, compiled by rumoca to an FMU, in the place of ours."""

from pathlib import Path

import numpy as np
import pytest
from docs.test_interoperability import ROWS
from fmpy import simulate_fmu
from grasp_cosim import InputError, SimulationError, System, cli, grasp_system, qualify, simulate
from support.foreign_tools import call, python_with

ROOT = Path(__file__).parents[2]
CASES = (0, 1, 2)
SOLVERS = {
    "CoSimulation": {},
    "ModelExchange": {"components.plant.solver.relative_tolerance": 1e-6},
}
(ROW,) = (r for r in ROWS if "`tests/modelica/test_plant_fmu.py`" in r.by)

both_versions = pytest.mark.parametrize("fmi", [2, 3])
both_kinds = pytest.mark.parametrize("kind", SOLVERS)


@pytest.fixture(scope="module")
def python():
    """The Python with the rumoca that exports."""
    return python_with(ROW.tool, ROW.version)


def compiled(python, folder, model, fmi, library=ROOT / "modelica/GraspCosim"):
    """The FMU of a model, by the script of the page."""
    fmu = folder / f"{model}_{fmi}.fmu"
    script = [ROOT / "docs/modelica_fmu.py", library, model, "-o", fmu, "--fmi", str(fmi)]
    assert call([python, *script], folder) == f"{fmu}: written, FMI {fmi}.0\n"
    return fmu


@pytest.fixture(scope="module")
def plants(python, tmp_path_factory):
    """The plant, by the version of FMI."""
    folder = tmp_path_factory.mktemp("plants")
    return {fmi: compiled(python, folder, "GraspCosim.Plant", fmi) for fmi in (2, 3)}


def times(result):
    return np.array(result.metrics["time_to_contact"])


@pytest.mark.interop
@both_versions
@both_kinds
def test_contact_times_in_the_loop(plants, fmi, kind, tmp_path, monkeypatch):
    """As `init` writes the system, without a line of mapping."""
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "compiled.toml", "--as", f"plant={plants[fmi]}"]) == 0
    system = System.load("compiled.toml").with_settings(SOLVERS[kind])
    for case in CASES:
        theirs = simulate(system.with_presets(f"case_{case}"))
        ours = simulate(grasp_system().with_presets(f"case_{case}"))
        assert abs(times(theirs) - times(ours)).max() <= float(ROW.deviation.split()[0])
        assert any("model exchange" in line for line in theirs.log) == bool(SOLVERS[kind])
    assert int(ROW.value.split()[0]) == 2 * len(CASES) * 4
    assert float(ROW.deviation.split()[0]) <= 3e-3


@pytest.mark.interop
@both_versions
@both_kinds
def test_it_is_qualified(plants, fmi, kind):
    solver = {key.rpartition(".")[2]: value for key, value in SOLVERS[kind].items()}
    assert qualify(grasp_system(), "plant", plants[fmi], solver=solver or None)


@pytest.mark.interop
@both_versions
@both_kinds
def test_the_plant_with_the_box_in_the_loop(python, natives, fmi, kind, tmp_path):
    fmu = compiled(python, tmp_path, "GraspCosim.PlantMovable", fmi)
    theirs = simulate(grasp_system().swap("plant", fmu).with_settings(SOLVERS[kind]))
    ours = simulate(grasp_system().swap("plant", natives / "GripperPlantMovable.fmu"))
    assert times(theirs) == pytest.approx(times(ours), abs=3e-4)
    assert theirs["plant.object_position"][-1] == pytest.approx(
        ours["plant.object_position"][-1], abs=3e-5
    )


@pytest.mark.interop
@both_versions
def test_the_sensor_in_the_loop(python, fmi, tmp_path):
    """On finger 1; it has no state, and one input and output."""
    fmu = compiled(python, tmp_path, "GraspCosim.Sensor", fmi)
    theirs = simulate(grasp_system().swap("sensor_1", fmu), stop=2.0)
    ours = simulate(grasp_system(), stop=2.0)
    name = "sensor_1.intensity"
    assert np.abs(theirs[name] - ours[name]).max() <= 1e-6 * np.abs(ours[name]).max()


# What rumoca cannot do: where it can, the page has one row less


def ran(python, folder, text, fmi, kind):
    """A model of one class in our master: 0.5 s in steps of 1 ms."""
    model = text.split()[1]
    (folder / f"{model}.mo").write_text(text, "utf-8")
    fmu = compiled(python, folder, model, fmi, folder / f"{model}.mo")
    solver = "solver = {}\n" if kind == "ModelExchange" else ""
    (folder / "it.toml").write_text(
        f'[experiment]\nstep = 1e-3\nstop = 0.5\n[components.it]\nfmu = "{fmu.name}"\n{solver}',
        "utf-8",
    )
    return simulate(System.load(folder / "it.toml"))


INITIALLY = """model Initially
  parameter Real a = 2;
  output Real y;
  Real x;
initial equation
  x = a;
equation
  der(x) = -x;
  y = x + 0*a;
end Initially;
"""


@pytest.mark.interop
@both_versions
@both_kinds
def test_initial_equations_are_ignored(python, fmi, kind, tmp_path):
    assert ran(python, tmp_path, INITIALLY, fmi, kind)["it.y"][0] == 0.0


@pytest.mark.interop
@both_versions
def test_a_start_that_is_a_parameter_is_no_number(python, fmi, tmp_path):
    text = INITIALLY.replace("initial equation\n  x = a;\n", "").replace(
        "Real x;", "Real x(start = a, fixed = true);"
    )
    with pytest.raises(InputError, match="variable 'x': start = 'a': must be a number"):
        ran(python, tmp_path, text, fmi, "CoSimulation")


SAMPLED = """model Sampled
  output Real y;
  discrete Real n(start = 0, fixed = true);
  Real x(start = 0, fixed = true);
equation
  der(x) = 1;
  when sample(0, 0.1) then
    n = pre(n) + 1;
  end when;
  y = n + 0*x;
end Sampled;
"""


@pytest.mark.interop
@both_versions
@both_kinds
def test_a_sampled_when_happens_in_model_exchange_by_fmi_2_only(python, fmi, kind, tmp_path):
    happens = (fmi, kind) == (2, "ModelExchange")
    assert ran(python, tmp_path, SAMPLED, fmi, kind)["it.y"][-1] == (5.0 if happens else 0.0)


CONTACT = """model Contact
  parameter Real m = 0.5;
  output Real gap;
  output Boolean contact;
  Real f;
  Real s(start = 0.01, fixed = true);
  Real v(start = 0, fixed = true);
equation
  der(s) = v;
  m*der(v) = f - 2;
  gap = s + 0*m;
  contact = gap <= 0;
  f = if gap > 0 then 0 else max(0, 2 - m*(400*v + 40000*gap));
end Contact;
"""


@pytest.mark.interop
def test_fmpy_loads_no_fmu_for_fmi_3(plants):
    """rumoca leaves out a function of scheduled execution; by FMI 2.0 FMPy runs both kinds."""
    push = {"force[1]": -2.0, "force[2]": 2.0}
    for kind in SOLVERS:
        result = simulate_fmu(plants[2], fmi_type=kind, start_values=push, stop_time=0.5)
        assert result["gap[1]"][-1] == pytest.approx(0.0, abs=1e-6)
        with pytest.raises(AttributeError, match="fmi3ActivateModelPartition"):
            simulate_fmu(plants[3], validate=False, fmi_type=kind, stop_time=0.5)


@pytest.mark.interop
def test_a_contact_with_an_event_chatters_or_never_touches(python, tmp_path):
    for fmi in (2, 3):
        with pytest.raises(SimulationError, match="chatters"):
            ran(python, tmp_path, CONTACT, fmi, "ModelExchange")
    result = ran(python, tmp_path, CONTACT, 3, "CoSimulation")
    assert result["it.gap"][-1] < -0.4
    assert "it.contact" not in result
