"""The cross-check files follow the rules, and an importer reproduces them from the FMU."""

import importlib
import re
import shutil
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
from block_variables import Input, Output
from conftest import Folder
from fmpy import read_model_description, simulate_fmu
from fmpy.cross_check.validate_vendor_repo import validate_test_fmu
from fmpy.util import read_csv, read_ref_opt_file, validate_result
from grasp_fmus.contract import declared, variables
from grasp_fmus.cross_check import STEP_SIZE, cross_check_files
from support.kinds import Kind, all_kinds
from support.slow import slow

BLOCKS = {
    "GripperPlant": "gripper_plant.rigid",
    "GripperPlantCompliant": "gripper_plant.compliant",
    "GripperPlantMovable": "gripper_plant.movable",
    "ProximitySensor": "proximity_sensor.channel",
    "GraspController": "grasp_controller.series",
    "GraspControllerAdaptive": "grasp_controller.adaptive",
}
STILL = {
    "GripperPlant": ["object_position"],
    "GripperPlantCompliant": ["object_position", "damaged"],
    "GripperPlantMovable": ["tilt", "toppled"],
}
"""What the inputs do not change: they shake the gripper, but break and topple nothing."""

LITERAL = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
"""A floating point literal of C."""


def block(name: str) -> ModuleType:
    return importlib.import_module(BLOCKS[name])


@pytest.fixture(
    scope="module",
    params=[slow(n) if n[12:] in ("Compliant", "Movable") else n for n in sorted(BLOCKS)],
)
def name(request: pytest.FixtureRequest) -> str:
    """The FMUs, one after the other."""
    return str(request.param)


@pytest.fixture(scope="module")
def folder(name: str, fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of an FMU, beside it, in a folder as the rules want it."""
    folder = tmp_path_factory.mktemp("repo") / f"fmus/2.0/cs/linux64/grasp-cosim/1/{name}"
    folder.mkdir(parents=True)
    for end in (".fmu", "_in.csv", "_ref.csv", "_ref.opt"):
        shutil.copy(fmus / f"{name}{end}", folder)
    return folder


def simulated(fmu: Path, folder: Path, name: str, **arguments: Any) -> Any:
    """The FMU, run by FMPy with the options and inputs in the folder."""
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    arguments = {"output_interval": options["StepSize"], **arguments}
    return simulate_fmu(
        fmu,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        input=read_csv(folder / f"{name}_in.csv"),
        **arguments,
    )


def test_the_files_are_named_as_the_rules_want(name: str, fmus: Path) -> None:
    files = cross_check_files(name, block(name))
    assert list(files) == [f"{name}_in.csv", f"{name}_ref.csv", f"{name}_ref.opt"]
    assert files == {file: (fmus / file).read_bytes() for file in files}


def test_fmpy_finds_no_problem_in_the_submission(folder: Path) -> None:
    assert validate_test_fmu(str(folder)) == []


@pytest.mark.parametrize(("suffix", "causality"), [("in", "input"), ("ref", "output")])
def test_a_csv_file_follows_the_rules(folder: Path, name: str, suffix: str, causality: str) -> None:
    description = read_model_description(folder / f"{name}.fmu")
    found = [v for v in description.modelVariables if v.causality == causality]
    path = folder / f"{name}_{suffix}.csv"
    head, *lines = path.read_text("ascii").splitlines()
    assert head == ",".join(f'"{column}"' for column in ["time", *(v.name for v in found)])
    assert path.stat().st_size < 1e6
    assert len(lines) <= 1000
    for cells in (line.split(",") for line in lines):
        assert all(map(LITERAL.fullmatch, cells))
        for v, cell in zip(found, cells[1:], strict=True):
            assert v.type != "Boolean" or cell in ("0", "1")


def test_the_rows_lie_on_the_communication_points(folder: Path, name: str) -> None:
    """Whether a host multiplies, adds up or counts nanoseconds."""
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    times = read_csv(folder / f"{name}_in.csv")["time"]
    assert np.array_equal(times, read_csv(folder / f"{name}_ref.csv")["time"])
    assert (times[0], times[-1]) == (options["StartTime"], options["StopTime"])
    assert options["OutputIntervalLength"] == options["StepSize"] == STEP_SIZE
    assert list(times) == list(accumulate([STEP_SIZE] * (len(times) - 1), initial=0.0))
    assert all((1e9 * t).is_integer() for t in map(float, times))


@all_kinds
def test_the_fmu_gives_the_reference_to_the_last_bit(
    folder: Path, folder_of: Folder, kind: Kind, name: str
) -> None:
    result = simulated(folder_of(kind) / f"{name}.fmu", folder, name)
    reference = read_csv(folder / f"{name}_ref.csv")
    assert set(result.dtype.names) == set(reference.dtype.names)
    for column in reference.dtype.names:
        assert result[column].astype(float).tobytes() == reference[column].tobytes(), column


def test_an_importer_with_a_step_of_its_own_passes(folder: Path, name: str) -> None:
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    result = simulated(
        folder / f"{name}.fmu", folder, name, step_size=options["StepSize"], output_interval=None
    )
    assert result["time"][1] != options["StepSize"]
    outside = validate_result(result, read_csv(folder / f"{name}_ref.csv"), options["StopTime"])
    # The rules allow 0.1. An impact may lie between two samples, and so may a jump in the ratio of
    # two intensities, of which the adaptive controller learns.
    assert outside < (0.08 if name == "GraspControllerAdaptive" else 0.002)


@pytest.mark.parametrize("name", sorted(BLOCKS))
def test_inputs_differ_jump_and_stay_within_the_nominal_value(name: str, fmus: Path) -> None:
    inputs = [v for v in variables(declared(block(name))) if v.causality == "input"]
    table = read_csv(fmus / f"{name}_in.csv")
    for v in inputs:
        values = table[v.name]
        off = np.abs(values - (v.start or 0.0)) / (v.nominal or 1.0)
        *_, second, first = sorted(np.abs(np.diff(values)))
        assert 0.2 < off.max() <= 1.0
        assert first > 4.0 * second
        assert not v.start or (np.sign(values) == np.sign(v.start)).all()
    assert len({table[v.name].tobytes() for v in inputs}) == len(inputs)


@dataclass(frozen=True)
class Params:
    """No parameters."""


class Inputs(NamedTuple):
    """A switch and a signal."""

    on: Annotated[bool, Input("a switch")] = True
    signal: Annotated[float, Input("a signal", unit="1", nominal=2.0)] = 1.0


class Outputs(NamedTuple):
    """The inverse of something that reaches zero, if it is wanted."""

    value: Annotated[float, Output("the value", unit="1", nominal=1.0, depends_on={"signal"})]


def other(power: float) -> Any:
    """A block that none of the signals is for."""
    return SimpleNamespace(
        Params=Params,
        Inputs=Inputs,
        Outputs=Outputs,
        initial_state=lambda p, u: None,
        step=lambda p, x, u, h: None,
        outputs=lambda p, x, u: Outputs(np.float64(1.0 - u.signal) ** power if u.on else 0.0),
    )


def test_a_switch_is_thrown_once() -> None:
    files = cross_check_files("Other", other(1.0))
    rows = [line.split(",") for line in files["Other_in.csv"].decode().splitlines()]
    assert rows[0] == ['"time"', '"on"', '"signal"']
    assert [row[1] for row in rows[1:]] == ["1"] * 384 + ["0"] * 385


@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_reference_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^Other: value = .*inf.* at 0\.\d* s: must be finite$"):
        cross_check_files("Other", other(-1.0))
