"""The cross-check files follow the rules, and an importer reproduces them from the FMU."""

import re
import shutil
from dataclasses import make_dataclass
from itertools import accumulate
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from block_variables import Input, Output
from fmpy import read_model_description, simulate_fmu
from fmpy.cross_check.validate_vendor_repo import validate_test_fmu
from fmpy.util import read_csv, read_ref_opt_file, validate_result
from grasp_cosim.fmu_export.contract import declared, variables
from grasp_cosim.fmu_export.cross_check import STEP_SIZE, cross_check_files
from grasp_cosim.fmu_export.shipped import blocks
from support.kinds import TRANSLATED, all_kinds
from support.marks import slow

BLOCKS = {name: block for name, block in blocks().items() if name in TRANSLATED}
LITERAL = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
"""A floating point literal of C."""


@pytest.fixture(
    scope="module", params=[slow(n) if n[12:] in ("Compliant", "Movable") else n for n in BLOCKS]
)
def name(request):
    """The FMUs, one after the other."""
    return str(request.param)


@pytest.fixture(scope="module")
def folder(name, fmus, tmp_path_factory):
    """The files of an FMU, beside it, in a folder as the rules want it."""
    folder = tmp_path_factory.mktemp("repo") / f"fmus/2.0/cs/linux64/grasp-cosim/1/{name}"
    folder.mkdir(parents=True)
    for end in (".fmu", "_in.csv", "_ref.csv", "_ref.opt"):
        shutil.copy(fmus / f"{name}{end}", folder)
    return folder


def simulated(fmu, folder, name, **arguments):
    """The FMU, run by FMPy with the options and inputs in the folder."""
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    inputs, stop = read_csv(folder / f"{name}_in.csv"), options["StopTime"]
    return simulate_fmu(fmu, start_time=0.0, stop_time=stop, input=inputs, **arguments)


def test_the_files_are_named_as_the_rules_want(name, fmus):
    files = cross_check_files(name, BLOCKS[name])
    assert list(files) == [f"{name}_in.csv", f"{name}_ref.csv", f"{name}_ref.opt"]
    assert files == {file: (fmus / file).read_bytes() for file in files}


def test_fmpy_finds_no_problem_in_the_submission(folder):
    assert validate_test_fmu(str(folder)) == []


@pytest.mark.parametrize(("suffix", "causality"), [("in", "input"), ("ref", "output")])
def test_a_csv_file_follows_the_rules(folder, name, suffix, causality):
    """Its rows lie on the communication points, as a host that adds up counts them."""
    description = read_model_description(folder / f"{name}.fmu")
    found = [v for v in description.modelVariables if v.causality == causality]
    path = folder / f"{name}_{suffix}.csv"
    head, *lines = path.read_text("ascii").splitlines()
    assert head == ",".join(f'"{column}"' for column in ["time", *(v.name for v in found)])
    assert path.stat().st_size < 1e6
    rows = [line.split(",") for line in lines]
    assert all(LITERAL.fullmatch(cell) for row in rows for cell in row)
    for place, v in enumerate(found, 1):
        assert v.type != "Boolean" or {row[place] for row in rows} <= {"0", "1"}
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    times = [float(row[0]) for row in rows]
    assert times == [*accumulate([STEP_SIZE] * 768, initial=0.0)]
    assert (times[0], times[-1]) == (options["StartTime"], options["StopTime"])
    assert options["OutputIntervalLength"] == options["StepSize"] == STEP_SIZE


@all_kinds
def test_the_fmu_gives_the_reference_to_the_last_bit(folder, folder_of, kind, name):
    fmu = folder_of(kind) / f"{name}.fmu"
    result = simulated(fmu, folder, name, output_interval=STEP_SIZE)
    reference = read_csv(folder / f"{name}_ref.csv")
    assert set(result.dtype.names) == set(reference.dtype.names)
    for column in reference.dtype.names:
        assert result[column].astype(float).tobytes() == reference[column].tobytes(), column


def test_an_importer_with_a_step_of_its_own_passes(folder, name):
    """The rules allow 0.1. An impact may lie between two samples, and so may a jump in the ratio of
    two intensities, of which a controller learns; a gripper in tandem and a hand meet what they
    move many times.
    """
    result = simulated(folder / f"{name}.fmu", folder, name, step_size=STEP_SIZE)
    assert result["time"][1] != STEP_SIZE
    outside = validate_result(result, read_csv(folder / f"{name}_ref.csv"), result["time"][-1])
    learns = name.endswith(("Adaptive", "ControllerTandem"))
    meets_often = name in ("TandemPlant", "HandPlantMovable")
    assert outside < (0.09 if learns else 0.005 if meets_often else 0.002)


def test_inputs_differ_jump_and_stay_within_the_nominal_value(folder, name):
    inputs = [v for v in variables(declared(BLOCKS[name])) if v.causality == "input"]
    table = read_csv(folder / f"{name}_in.csv")
    for v in inputs:
        values = table[v.name]
        off = np.abs(values - (v.start or 0.0)) / (v.nominal or 1.0)
        *_, second, first = sorted(np.abs(np.diff(values)))
        assert 0.2 < off.max() <= 1.0
        assert first > 4.0 * second
        assert not v.start or (np.sign(values) == np.sign(v.start)).all()
    assert len({table[v.name].tobytes() for v in inputs}) == len(inputs)


class Inputs(NamedTuple):
    """A switch and a signal."""

    on: Annotated[bool, Input("a switch")] = True
    signal: Annotated[float, Input("a signal", unit="1", nominal=2.0)] = 1.0


class Outputs(NamedTuple):
    """A power of something that reaches zero, if it is wanted."""

    value: Annotated[float, Output("the value", unit="1", nominal=1.0, depends_on={"signal"})]


def other(power):
    """A block with this power."""
    return SimpleNamespace(
        Params=make_dataclass("Params", ()), Inputs=Inputs, Outputs=Outputs,
        initial_state=lambda p, u: None, step=lambda p, x, u, h: None,
        outputs=lambda p, x, u: Outputs(np.float64(1.0 - u.signal) ** power if u.on else 0.0),
    )  # fmt: skip


def test_a_switch_is_thrown_once():
    rows = cross_check_files("Other", other(1.0))["Other_in.csv"].decode().splitlines()
    assert rows[0] == '"time","on","signal"'
    assert [row.split(",")[1] for row in rows[1:]] == ["1"] * 384 + ["0"] * 385


@pytest.mark.filterwarnings("ignore:divide by zero")
def test_a_reference_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match=r"^Other: value = .*inf.* at 0\.\d* s: must be finite$"):
        cross_check_files("Other", other(-1.0))
