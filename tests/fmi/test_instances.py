"""Instances of native FMUs of both versions, here and in processes of their own."""

import ctypes
import math
import re
import tempfile
import zipfile

import numpy as np
import pytest
from fmi.instances import KINDS, SAMPLES, Bound, real, running, variable
from fmpy import simulate_fmu
from grasp_cosim import InputError, SimulationError
from grasp_cosim.base.calls import STEP_2, STEP_3, TRANSFER_2, TRANSFER_3
from grasp_cosim.fmi.instance import DISCARD, EARLY, OK
from grasp_cosim.fmi.make_instance import load
from grasp_cosim.interface.obstacles import this_platform
from grasp_cosim.system.parts import Component
from support.native_fmus import EARLY as MIGHT_RETURN_EARLY
from support.native_fmus import TYPES, build, needs_gcc
from support.packages import skip_where_fmpy_runs_none

pytestmark = needs_gcc
both = pytest.mark.parametrize(("version", "isolation"), KINDS)


@both
def test_every_scalar_type_goes_through_a_bound_call(tmp_path, version, isolation):
    with running(tmp_path, version, isolation) as part:
        bound = Bound(part, 0.1)
        for fmi_type in TYPES[version]:
            if fmi_type != "String":
                put, sent = bound.exchange("set", f"u_{fmi_type}")
                fetch, got = bound.exchange("get", f"y_{fmi_type}")
                sent[0] = SAMPLES[fmi_type]
                assert (put(), bound.step(), fetch()) == (OK, OK, OK), fmi_type
                assert got.tolist() == [SAMPLES[fmi_type]], fmi_type


@both
def test_start_values_of_every_type_are_set(tmp_path, version, isolation):
    values = {f"u_{t}": SAMPLES[t] for t in TYPES[version]}
    with running(tmp_path, version, isolation, values) as part:
        got = part.get([variable(part, f"y_{t}") for t in TYPES[version]])
    assert got == list(values.values())


@both
def test_a_run_agrees_with_fmpy(tmp_path, version, isolation):
    """FMPy runs the same FMU with a constant input: an independent master."""
    skip_where_fmpy_runs_none(version)
    step, steps, u, gain = 0.1, 20, 0.7, 1.3
    start = {f"u_{real(version)}": u, "gain": gain}
    reference = simulate_fmu(
        str(build(tmp_path, "reference", version, complete=version == "3.0")),
        stop_time=step * steps, output_interval=step, start_values=start, output=["x", "now"],
    )  # fmt: skip
    with running(tmp_path, version, isolation, start) as part:
        bound = Bound(part, step)
        fetch, got = bound.exchange("get", "x", "now")
        rows = []
        for k in range(steps):
            bound.clock[0] = reference["time"][k]
            assert (bound.step(), fetch()) == (OK, OK)
            rows.append(got.tolist())
    assert [row[0] for row in rows] == pytest.approx(reference["x"][1:], rel=1e-13)
    assert rows[-1][0] == pytest.approx(gain * u * step * steps, rel=1e-13)


@both
def test_an_error_tells_what_the_fmu_logged(tmp_path, version, isolation):
    with running(tmp_path, version, isolation, {"error_at": 0.25}) as part:
        bound = Bound(part, 0.2)
        assert bound.step() == OK
        bound.clock[0] = 0.2
        error = part.failure(bound.step(), 0.2)
    assert str(error) == "part: native.fmu returned error at t = 0.2 s: the lamp is broken"
    assert error.__notes__ == ["the lamp\nis broken"]


@both
def test_a_failed_get_names_component_and_reason(tmp_path, version, isolation):
    with running(tmp_path, version, isolation) as part:
        foreign = variable(part, "gain")
        wrong = type(foreign)(
            "gone", "Real", "output", 999, None, None, -math.inf, math.inf, real(version)
        )
        message = r"^part: native.fmu returned error at t = 0 s: no such variable"
        with pytest.raises(SimulationError, match=message):
            part.get([wrong])


@both
def test_refused_start_values_are_a_wrong_input(tmp_path, version, isolation):
    message = "^part: native.fmu refused its initialisation: gain must be >= 0$"
    with (
        pytest.raises(InputError, match=message),
        running(tmp_path, version, isolation, {"gain": -1.0}),
    ):
        pass


@both
def test_a_discarded_step_got_nowhere(tmp_path, version, isolation):
    with running(tmp_path, version, isolation, {"discard_at": 0.35}) as part:
        bound = Bound(part, 0.2)
        bound.clock[0] = 0.2
        assert bound.step() == DISCARD
        assert part.last_successful_time() == 0.2
        error = part.failure(DISCARD, 0.2)
    assert str(error) == "part: native.fmu returned discard at t = 0.2 s: the step is too long"


@both
def test_a_step_that_ends_early_tells_where(tmp_path, version, isolation):
    start = {"early_at": 0.35, f"u_{real(version)}": 2.0}
    with running(tmp_path, version, isolation, start, MIGHT_RETURN_EARLY) as part:
        bound = Bound(part, 0.2)
        bound.clock[0] = 0.2
        assert bound.step() == (DISCARD if version == "2.0" else EARLY)
        assert part.last_successful_time() == 0.35
        rest, box = part.stepper(np.array([0.35]), 0.05), variable(part, "x")
        assert rest.python() == OK
        assert part.get([box]) == [pytest.approx(0.4, rel=1e-13)]


def test_a_step_ends_early_only_where_its_length_may_vary(tmp_path):
    fixed = {"mightReturnEarlyFromDoStep": "true"}
    with running(tmp_path, "3.0", values={"early_at": 0.1}, capabilities=fixed) as part:
        assert Bound(part, 0.2).step() == OK


@both
def test_a_wish_to_end_the_simulation_is_told(tmp_path, version, isolation):
    with running(tmp_path, version, isolation, {"terminate_at": 0.1}) as part:
        status = Bound(part, 0.2).step()
        assert status == (DISCARD if version == "2.0" else EARLY)
        assert part.the_end() == 0.1
    with running(tmp_path, version, isolation, {"early_at": 0.1}, MIGHT_RETURN_EARLY) as part:
        Bound(part, 0.2).step()
        assert part.the_end() is None


def test_structural_parameters_are_set_in_configuration_mode(tmp_path):
    with running(tmp_path, "3.0", values={"size": 7, "gain": 2.0}) as part:
        assert part.get([variable(part, "size_out"), variable(part, "gain")]) == [7, 2.0]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_native_call_is_the_python_call(tmp_path, version):
    """Called by the addresses alone, as the compiled loop does, the FMU does the same."""
    with running(tmp_path, version) as part:
        u, x = (variable(part, name) for name in (f"u_{real(version)}", "x"))
        sent, got, clock = np.array([3.0]), np.zeros(1), np.zeros(2)
        put, fetch = part.transfer("set", [u], sent).native, part.transfer("get", [x], got).native
        step = part.stepper(clock, 0.5).native
        assert put is not None
        assert fetch is not None
        assert step is not None
        word, status, double = ctypes.c_size_t, ctypes.c_int, ctypes.c_double
        if version == "2.0":
            assert (put.shape, step.shape) == (TRANSFER_2, STEP_2)
            transfer = ctypes.CFUNCTYPE(status, *[word] * 4)
            tail = []
            advance = ctypes.CFUNCTYPE(status, word, double, double, status)
        else:
            assert (put.shape, step.shape) == (TRANSFER_3, STEP_3)
            transfer = ctypes.CFUNCTYPE(status, *[word] * 5)
            tail = [1]
            advance = ctypes.CFUNCTYPE(
                status, word, double, double, ctypes.c_bool, word, word, word, word
            )
        flags = [step.flags, step.flags + 1, step.flags + 2, step.last] if tail else []
        for call in (put, fetch):
            assert call.size == 1
        assert transfer(put.function)(put.instance, put.references, 1, put.data, *tail) == OK
        assert advance(step.function)(step.instance, clock[0], step.step, 1, *flags) == OK
        assert transfer(fetch.function)(
            fetch.instance, fetch.references, 1, fetch.data, *tail
        ) == OK  # fmt: skip
    assert got.tolist() == [1.5]


@both
def test_without_a_binary_for_this_machine(tmp_path, version, isolation):
    whole, other = build(tmp_path, version=version), tmp_path / "other.fmu"
    with zipfile.ZipFile(whole) as archive, zipfile.ZipFile(other, "w") as elsewhere:
        for name in archive.namelist():
            moved = re.sub("^binaries/[^/]+", "binaries/win64", name)
            elsewhere.writestr(moved, archive.read(name))
    ours = this_platform(version)
    with pytest.raises(InputError) as error:
        load(Component("part", other, {}, isolation=isolation))
    assert str(error.value) == (
        f"part: {other} has a binary for win64 only; this machine: {ours}; ask the vendor for an "
        f"FMU with a binary for {ours}"
    )


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_what_is_extracted_is_what_this_machine_uses(tmp_path, monkeypatch, version):
    fmu = build(tmp_path, version=version)
    with zipfile.ZipFile(fmu, "a") as archive:
        binaries = [name for name in archive.namelist() if name.startswith("binaries/")]
        for other in ("binaries/win64/x.dll", "documentation/x", "sources/x.c", "extra/x/y"):
            archive.writestr(other, "")
    folder = tmp_path / "extracted"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    instance = load(Component("part", fmu, {}))
    files = {
        p.relative_to(folder).as_posix().partition("/")[2]
        for p in folder.glob("*/**/*")
        if p.is_file()
    }
    instance.close()
    assert files == {"modelDescription.xml", "extra/x/y", *binaries}
    assert not list(folder.iterdir())
