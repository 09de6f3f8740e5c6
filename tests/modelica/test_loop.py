"""The loop in Modelica, integrated by rumoca, against ours: they share no line.

rumoca gives samples 0.1 ms apart; the contact is the zero of a straight line between two of them.
Our contact times have an error of first order in the step: two steps give their limit.
"""

from pathlib import Path

import numpy as np
import pytest
from docs.test_interoperability import ROWS
from grasp_cosim import grasp_system, simulate
from support.foreign_tools import python_with, run_in

PACKAGE = str(Path(__file__).parents[2] / "modelica")
CASES = (0, 1, 2)
PLACES = (-0.03, -0.02, -0.01, 0.0, 0.01, 0.02, 0.03)  # m
STEP = 2e-5  # s
FINGERS = (1, 2)
(ROW,) = (r for r in ROWS if "`tests/modelica/test_loop.py`" in r.by)

RUMOCA = """
from rumoca import Session, SimConfig
session = Session([given["folder"]])
bdf = SimConfig(solver="bdf", rtol=1e-9, atol=1e-11)
for text in given["models"]:
    loop = session.loads(text, model="It", filename="it.mo")
    result = loop.simulate(3.0, dt=1e-4, config=bdf)
    found.append({name: list(result[name]) for name in given["signals"]})
    found[-1]["time"] = list(result.time)
"""

LOOP = """
model It
  extends GraspCosim.Loop(
    {plant}(initial_object_position = {place}),
    controller(
      simultaneous_contact(enabled = {layer_3}),
      impact_reduction(enabled = {layer_2})));
end It;
"""


def integrated(folder, plant, runs):
    """By rumoca, for cases and places in m: the contact times in s, and the object at the end."""
    models = [
        LOOP.format(
            plant=plant, place=place, layer_3=str(case > 1).lower(), layer_2=str(case > 0).lower()
        )
        for case, place in runs
    ]
    names = [f"plant.position[{j}]" for j in FINGERS] + ["plant.object_position"]
    given = {"folder": PACKAGE, "models": models, "signals": names}
    found = run_in(python_with(ROW.tool, ROW.version), RUMOCA, folder, given)
    return [(_contacts(f), f["plant.object_position"][-1]) for f in found]


def _contacts(signals):
    x_1, x_2, x_m = (
        np.array(signals[f"plant.{n}"]) for n in ("position[1]", "position[2]", "object_position")
    )
    return [_zero(np.array(signals["time"]), gap - 0.035) for gap in (x_1 - x_m, x_m - x_2)]


def _zero(time, gap):
    k = np.flatnonzero((gap[1:] <= 0.0) & (gap[:-1] > 0.0))[0]
    return time[k] + (time[k + 1] - time[k]) * gap[k] / (gap[k] - gap[k + 1])


def ours(system, case, place, step):
    system = system.with_presets(f"case_{case}").with_experiment(step, stop=3.0)
    return simulate(system.with_values({"plant.initial_object_position": place}))


def contacts(run):
    return np.array([run[f"plant.first_contact_time[{j}]"][-1] for j in FINGERS])


@pytest.mark.interop
def test_contact_times_of_the_rigid_object(tmp_path):
    runs = [(case, place) for case in CASES for place in PLACES]
    theirs = integrated(tmp_path, "plant", runs)
    system = grasp_system()
    deviations = [
        np.abs(
            2.0 * contacts(ours(system, *run, STEP / 2)) - contacts(ours(system, *run, STEP)) - t
        )
        for run, (t, _) in zip(runs, theirs, strict=True)
    ]
    largest = np.max(deviations)
    assert int(ROW.value.split()[0]) == 2 * len(runs)
    assert largest <= float(ROW.deviation.split()[0])
    assert float(ROW.deviation.split()[0]) <= 1e-5


REDECLARED = """
from rumoca import Session
session = Session([given["folder"]])
for example in ("Loop", "Examples.Case2"):
    redeclared = f"GraspCosim.{example}(redeclare GraspCosim.PlantMovable plant)"
    text = f"model It extends {redeclared}; end It;"
    model = session.loads(text, model="It", filename="it.mo")
    found.append("plant.object_mass" in model.parameters.names)
"""


@pytest.mark.interop
def test_a_redeclaration_two_levels_below_is_ignored(tmp_path):
    """Where it is not, the page has one row less."""
    python = python_with(ROW.tool, ROW.version)
    assert run_in(python, REDECLARED, tmp_path, {"folder": PACKAGE}) == [True, False]


@pytest.mark.interop
def test_contact_times_and_the_way_of_the_box(natives, tmp_path):
    """In Case 1 one finger pushes it across to the other one, 55 mm."""
    runs = [(0, 0.03), (1, 0.03), (2, 0.03), (2, 0.0), (2, -0.02)]
    theirs = integrated(tmp_path, "redeclare GraspCosim.PlantMovable plant", runs)
    system = grasp_system().swap("plant", natives / "GripperPlantMovable.fmu")
    for run, (times, place) in zip(runs, theirs, strict=True):
        result = ours(system, *run, 1e-4)
        assert contacts(result) == pytest.approx(times, abs=1e-4)
        assert result["plant.object_position"][-1] == pytest.approx(place, abs=3e-5)
