"""What a run has recorded drives another system as it is."""

import numpy as np
import pytest
from comparison.made import write_fmu
from grasp_cosim import System, simulate
from grasp_cosim.base.errors import InputError
from grasp_cosim.recording.folder import RunFolder

ALONE = """
[experiment]
step = 4e-3
stop = 1.0

[components.controller]
fmu = "GraspController.fmu"
"""


@pytest.fixture(scope="module")
def recorded(grasp, tmp_path_factory):
    """The folder of a grasp."""
    folder = tmp_path_factory.mktemp("recorded")
    system = grasp.with_experiment(step=4e-3, stop=1.0)
    with RunFolder(folder, system, ("test",)) as writer:
        result = simulate(system, listeners=[writer], finish=lambda r, _: writer.finish(r))
    return folder, result


def alone(folder, fmus, recorded, text=ALONE):
    path = folder / "alone.toml"
    path.write_text(text)
    return System.load(path, fmus, input=recorded)


def test_a_controller_gets_what_went_through_its_connections(recorded, fmus, tmp_path):
    """At each communication point it has the inputs of then, a step later than in the loop."""
    folder, result = recorded
    system = alone(tmp_path, fmus, folder / "signals.csv")
    ports = {str(port) for port in system.input.columns}
    assert ports == {
        f"controller.{name}[{j}]" for name in ("position", "velocity", "intensity") for j in (1, 2)
    }
    (note,) = (n for n in system.notes if "recorded run" in n)
    assert note.startswith("signals.csv: a recorded run: controller.position[1],")
    replayed = simulate(system.with_record("controller.*"))
    for name in ("position[1]", "intensity[2]"):
        source = {"position[1]": "plant.position[1]", "intensity[2]": "sensor_2.intensity"}[name]
        np.testing.assert_array_equal(
            replayed[f"controller.{name}"][1:], result[source][:-1], err_msg=name
        )


@pytest.mark.parametrize(
    ("change", "factor", "offset"),
    [({}, 1.0, 0.0), ({"factor": 2.0}, 2.0, 0.0), ({"offset": 0.5}, 1.0, 0.5),
     ({"factor": -3.0, "offset": 0.25}, -3.0, 0.25), ({"factor": 1.0, "offset": 0.0}, 1.0, 0.0)],
)  # fmt: skip
def test_what_went_through_a_connection_is_scaled_as_that_was(tmp_path, change, factor, offset):
    def rising(t, inputs):
        return {"gap": 10.0 * t}

    def watching(t, inputs):
        return {}

    connection = {"from": "plant.gap", "to": "spring.position", **change}
    experiment = {"step": 0.1, "stop": 0.5}
    run = simulate(
        System(
            components={"plant": rising, "spring": watching},
            connections=[connection],
            experiment=experiment,
        )
    )
    run.save(tmp_path / "run")
    write_fmu(tmp_path / "spring.fmu", {"position": 'causality="input" | Real start="0"'})
    (tmp_path / "alone.toml").write_text(
        '[experiment]\nstep = 0.1\nstop = 0.5\n[components.spring]\nfmu = "spring.fmu"\n'
    )
    system = System.load(tmp_path / "alone.toml", input=tmp_path / "run" / "signals.csv")
    (column,) = system.input.columns.values()
    assert [*column.samples] == [factor * gap + offset for gap in run["plant.gap"]]


def test_a_run_that_can_drive_nothing_is_refused(recorded, fmus, tmp_path):
    folder, _ = recorded
    text = ALONE.partition("[components.controller]")[0] + '[components.p]\nfmu = "HandPlant.fmu"\n'
    with pytest.raises(InputError, match="is a recorded run, none of whose columns can drive"):
        alone(tmp_path, fmus, folder / "signals.csv", text)


def test_of_another_table_each_column_must_be_right(recorded, fmus, tmp_path):
    folder, _ = recorded
    copied = tmp_path / "copied.csv"
    copied.write_bytes((folder / "signals.csv").read_bytes())
    with pytest.raises(InputError, match="no component 'plant'"):
        alone(tmp_path, fmus, copied)


def test_a_damaged_run_json_is_said(recorded, fmus, tmp_path):
    folder, _ = recorded
    (tmp_path / "signals.csv").write_bytes((folder / "signals.csv").read_bytes())
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(InputError, match=r"run\.json: no entry 'connections'; must have one"):
        alone(tmp_path, fmus, tmp_path / "signals.csv")
