"""An FMU as a host sees it: plain FMPy, many instances, values before and after a set."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Folder
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from grasp_controller import adaptive, series
from gripper_plant import compliant, movable, mujoco_box, rigid
from proximity_sensor import channel
from support.kinds import Kind, all_kinds
from support.packages import skip_where_it_cannot_run

pytestmark = all_kinds

BLOCKS: dict[str, Any] = {
    "GripperPlant": rigid,
    "GripperPlantCompliant": compliant,
    "GripperPlantMovable": movable,
    "GripperPlantMuJoCo": mujoco_box,
    "ProximitySensor": channel,
    "GraspController": series,
    "GraspControllerAdaptive": adaptive,
}


class Fmi3(FMU3Slave):  # type: ignore[misc]  # FMPy is not typed
    """With the names that FMPy's class for FMI 2.0 has."""

    getReal, setReal = FMU3Slave.getFloat64, FMU3Slave.setFloat64

    def setupExperiment(self, startTime: float) -> None:
        """Nothing: the time is given in enterInitializationMode()."""


class Host:
    """An instance driven by FMPy's own class, by variable name."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        description = read_model_description(fmu)
        if not folder.exists() or not any(folder.iterdir()):  # never over a library that is loaded
            extract(fmu, folder)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.slave: Any = (FMU2Slave if description.fmiVersion == "2.0" else Fmi3)(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="host",
        )
        self.slave.instantiate()
        self.slave.setupExperiment(startTime=0.0)

    def get(self, name: str) -> float:
        return float(self.slave.getReal([self.references[name]])[0])

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.slave.setReal([self.references[name]], [value])

    def __enter__(self) -> "Host":
        return self

    def __exit__(self, *_: object) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


@pytest.fixture(scope="module")
def of(folder_of: Folder, kind: Kind) -> Path:
    """The folder with the FMUs of the kind that the test is run on."""
    return folder_of(kind)


@pytest.mark.parametrize("name", BLOCKS)
def test_runs_in_plain_fmpy(of: Path, name: str) -> None:
    skip_where_it_cannot_run(name)
    result: Any = simulate_fmu(of / f"{name}.fmu", stop_time=0.01, validate=True)
    assert len(result) > 10
    assert all(np.isfinite(result[column]).all() for column in result.dtype.names)


def test_a_free_finger_in_plain_fmpy_is_a_parabola(of: Path) -> None:
    result: Any = simulate_fmu(
        of / "GripperPlant.fmu",
        stop_time=0.1,
        step_size=1e-3,
        start_values={"force[1]": -1.0, "finger_mass[1]": 0.8},
    )
    expected = 0.11 - 0.5 / 0.8 * result["time"] ** 2
    np.testing.assert_allclose(result["position[1]"], expected, rtol=1e-13)
    assert (result["position[2]"] == -0.11).all()


def test_outputs_agree_with_inputs_in_initialisation_mode(of: Path, tmp_path: Path) -> None:
    with Host(of / "ProximitySensor.fmu", tmp_path) as host:
        host.slave.enterInitializationMode()
        for gap, reflectance in ((0.02, 1.0), (0.01, 0.5)):
            host.set(gap=gap, reflectance=reflectance)
            expected = 0.0024 * reflectance / (gap + 0.005) ** 1.1506
            assert host.get("intensity") == pytest.approx(expected, rel=1e-14)


def test_outputs_follow_a_tunable_parameter_at_run_time(of: Path, tmp_path: Path) -> None:
    with Host(of / "ProximitySensor.fmu", tmp_path) as host:
        host.slave.enterInitializationMode()
        host.slave.exitInitializationMode()
        host.slave.doStep(0.0, 1e-3)
        before = host.get("intensity")
        host.set(reflectance=0.25)
        assert host.get("intensity") == 0.25 * before
        host.slave.doStep(1e-3, 1e-3)
        assert host.get("intensity") == 0.25 * before


def test_values_in_any_order(of: Path, tmp_path: Path) -> None:
    with Host(of / "GraspController.fmu", tmp_path) as host:
        names = ["intensity[2]", "position[1]", "intensity[1]"]
        references = [host.references[name] for name in names]
        host.slave.enterInitializationMode()
        host.slave.setReal(references, [0.3, 0.1, 0.2])
        assert host.slave.getReal(references[::-1]) == [0.2, 0.1, 0.3]
        assert host.get("virtual_position[1]") == 0.1


@pytest.mark.slow
def test_many_instances_come_and_go(of: Path, tmp_path: Path) -> None:
    """pythonfmu 0.7.0 alone crashes the process at the second or third instance."""
    for k in range(40):
        with Host(of / "ProximitySensor.fmu", tmp_path / str(k % 3)) as host:
            host.slave.enterInitializationMode()
            assert host.get("intensity") > 0.0


def test_no_values_at_all(of: Path, tmp_path: Path) -> None:
    with Host(of / "ProximitySensor.fmu", tmp_path) as host:
        host.slave.enterInitializationMode()
        host.slave.setReal([], [])
        assert host.slave.getReal([]) == []


def test_a_host_outlives_what_a_block_refuses(of: Path, tmp_path: Path) -> None:
    """pythonfmu 0.7.0 alone: terminate or free after an exception crashes the process."""
    for k in range(20):
        with Host(of / "GripperPlant.fmu", tmp_path / str(k % 3)) as host:
            host.set(object_width=0.5)
            for _ in range(3):
                with pytest.raises(FMICallException, match="EnterInitializationMode"):
                    host.slave.enterInitializationMode()
            if k % 2:  # and may even go on, with a value that fits
                host.set(object_width=0.05)
                host.slave.enterInitializationMode()
                assert host.get("gap[1]") == pytest.approx(0.055)


@pytest.mark.parametrize(
    ("name", "block"),
    BLOCKS.items(),
)
def test_start_values_are_those_of_the_block(
    of: Path, tmp_path: Path, name: str, block: Any
) -> None:
    skip_where_it_cannot_run(name)
    with Host(of / f"{name}.fmu", tmp_path) as host:
        host.slave.enterInitializationMode()
        u = block.Inputs()
        y = block.outputs(block.Params(), block.initial_state(block.Params(), u), u)
        for field, value in y._asdict().items():
            if isinstance(value, tuple):
                pairs = [(f"{field}[{i + 1}]", v) for i, v in enumerate(value)]
            else:
                pairs = [(field, value)]
            for variable, expected in pairs:
                if not isinstance(expected, bool):
                    assert host.get(variable) == expected
