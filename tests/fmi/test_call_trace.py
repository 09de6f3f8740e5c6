"""The trace of the calls of an FMU, which two tools can be compared by."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from fmi.test_event_mode import TICK, clock, sampled
from fmi.test_instances import real
from fmi.test_isolation import system_file
from fmpy import simulate_fmu
from grasp_cosim import InputError, SimulationError, System, simulate, sweep
from grasp_cosim.cli import main
from grasp_cosim.system.parts import Component
from support.marks import engines, slow
from support.native_fmus import (
    CAPABLE,
    EVENT_MODE,
    build,
    build_model,
    needs_cvode,
    needs_gcc,
    starts,
)

pytestmark = needs_gcc
versions = pytest.mark.parametrize("version", ["2.0", "3.0"])
DO_STEP = re.compile(r"fmi\dDoStep\(.*")


def traced_system(folder, version, values="", isolation="none"):
    """Two parts, of which the second is traced."""
    system = System.load(system_file(folder, version, values, isolation))
    first, second = system.components
    return replace(system, components=(first, replace(second, trace=folder / "trace")))


def lines(folder, name="trace"):
    return (folder / name).read_text("utf-8").splitlines()


def alone(component, step=0.1, stop=1.0):
    times = round(step * 1e9), round(stop * 1e9)
    return System("alone", (component,), (), *times, "sequential")


def calls(traced):
    """The names of the functions in the order of their first calls."""
    return list(dict.fromkeys(re.findall(r" (fmi\w+)\(", "\n".join(traced))))


@versions
@engines
def test_a_trace_has_each_call_and_the_signals_keep_their_bits(tmp_path, version, engine):
    plain = simulate(System.load(system_file(tmp_path, version, "", "none")), engine=engine)
    result = simulate(traced_system(tmp_path, version), engine=engine)
    assert all((result[name] == plain[name]).all() for name in plain)
    traced = lines(tmp_path)
    steps = [line for line in traced if "DoStep" in line]
    assert len(steps) == 20
    assert steps[3].startswith(
        f"t=0.3 fmi{version[0]}DoStep(currentCommunicationPoint=0.3, "
        "communicationStepSize=0.1, noSetFMUStatePriorToCurrentPoint=1"
    )
    returned = (
        ""
        if version == "2.0"
        else (", eventHandlingNeeded=0, terminateSimulation=0, earlyReturn=0, ")
    )
    assert returned in steps[3]
    assert all(line.endswith(" -> OK") for line in steps)
    assert "Instantiate" in traced[0]
    assert traced[-2:] == [
        f"t=1.9 fmi{version[0]}Terminate() -> OK",
        f"t=1.9 fmi{version[0]}FreeInstance()",
    ]


@versions
def test_numbers_in_a_trace_read_back_to_the_last_bit(tmp_path, version):
    result = simulate(traced_system(tmp_path, version))
    kind = real(version)
    name = "value" if version == "2.0" else "values"
    found = [
        [float(number) for number in re.search(rf"{name}=\[([^\]]*)\]", line)[1].split(", ")]
        for line in lines(tmp_path)
        if re.match(rf"t=\S+ fmi\dGet{kind}\(", line)
    ]
    ends = found[-20:]
    recorded = result["second.x"].tolist()[1:]
    assert all(x in values for x, values in zip(recorded, ends, strict=True))


@versions
def test_a_process_of_its_own_writes_the_same_trace(tmp_path, version):
    traces = []
    for isolation in ("none", "process"):
        simulate(traced_system(tmp_path, version, isolation=isolation))
        traces.append([re.sub(r"resource\w+=\"[^\"]*\"", "", line) for line in lines(tmp_path)])
    here, there = ([line for line in trace if "DoStep" in line] for trace in traces)
    assert here == there
    assert calls(traces[0]) == calls(traces[1])


@versions
def test_the_last_line_is_the_call_in_which_an_fmu_crashed(tmp_path, version):
    system = traced_system(tmp_path, version, ", crash_at = 1.05", "process")
    with pytest.raises(SimulationError, match="SIGSEGV"):
        simulate(system)
    (last,) = re.findall(r"^t=1.0 .*", "\n".join(lines(tmp_path)[-1:]))
    assert last == (
        f"t=1.0 fmi{version[0]}DoStep(currentCommunicationPoint=1.0, communicationStepSize=0.1, "
        "noSetFMUStatePriorToCurrentPoint=1"
    )


def test_steps_are_those_that_fmpy_logs(tmp_path):
    """But for the address of the instance, which FMPy writes, too."""
    fmu = build_model("bouncing_ball", tmp_path, "2.0", ["CoSimulation"])
    logged = []
    simulate_fmu(str(fmu), stop_time=1.0, output_interval=0.25, step_size=0.25,
                 fmi_type="CoSimulation", fmi_call_logger=logged.append)  # fmt: skip
    simulate(alone(Component("ball", fmu, {}, trace=tmp_path / "trace"), step=0.25))
    ours = DO_STEP.findall("\n".join(lines(tmp_path)))
    theirs = [re.sub(r"c=\w+, ", "", line) for line in logged if "DoStep" in line]
    assert ours == theirs


@needs_cvode
@pytest.mark.parametrize("version", ["2.0", slow("3.0")])
def test_model_exchange_has_the_evaluations_of_its_solver(tmp_path, version):
    fmu = build_model("bouncing_ball", tmp_path, version, ["ModelExchange"])
    plain = simulate(alone(Component("ball", fmu, {})))
    result = simulate(alone(Component("ball", fmu, {}, trace=tmp_path / "trace")))
    assert all((result[name] == plain[name]).all() for name in plain)
    traced = lines(tmp_path)
    text = "\n".join(traced)
    if version == "2.0":
        event = r"eventInfo={newDiscreteStatesNeeded=0, .*, nextEventTime=\S+} -> OK"
        assert re.search(rf"fmi2NewDiscreteStates\({event[:-6]}\) -> OK", text)
        assert re.search(r"fmi2GetDerivatives\(derivatives=\[\S+, -9.81\], nx=2\) -> OK", text)
    else:
        assert re.search(r"fmi3UpdateDiscreteStates\(discreteStatesNeedUpdate=0, .*=\S+\) ->", text)
        assert "nContinuousStates=2) -> OK" in text


def test_event_mode_has_its_clocks(tmp_path):
    more = clock("changing", TICK)
    part = replace(sampled(tmp_path, more), trace=tmp_path / "trace")
    simulate(alone(part))
    text = "\n".join(lines(tmp_path))
    assert re.search(
        rf"fmi3GetIntervalDecimal\(valueReferences=\[{TICK}\], nValueReferences=1, "
        r"intervals=\[\S+\], qualifiers=\[\d\]\) -> OK",
        text,
    )
    assert f"fmi3SetClock(valueReferences=[{TICK}], nValueReferences=1, values=[1]) -> OK" in text
    assert "fmi3EnterStepMode() -> OK" in text


@versions
def test_states_are_told_apart_by_their_addresses(tmp_path, version):
    form, base = ("FMUstate", CAPABLE) if version == "2.0" else ("FMUState", EVENT_MODE)
    fmu = build(tmp_path, version=version, capabilities={**base, f"canGetAndSet{form}": "true"})
    part = Component("part", fmu, starts(version), trace=tmp_path / "trace")
    with simulate.session(alone(part)) as session:
        session.step(3)
        state = session.save()
        session.step(3)
        session.restore(state)
    text = "\n".join(lines(tmp_path))
    taken = re.search(rf"Get{form}\({form}=(0x\w+)\) -> OK", text)[1]
    assert f"Set{form}({form}={taken}) -> OK" in text


def test_a_refused_call_has_its_status(tmp_path):
    system = traced_system(tmp_path, "2.0", ", error_at = 1.05")
    with pytest.raises(SimulationError):
        simulate(system)
    assert [line for line in lines(tmp_path) if line.endswith("-> ERROR")]


def test_it_is_asked_for_in_a_file_and_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path = system_file(tmp_path, "2.0", "", "none")
    path.write_text(path.read_text() + 'trace = "second.trace"\n')
    assert main(["run", str(path), "--set", "components.first.trace=first.trace"]) == 0
    assert lines(tmp_path, "first.trace")[1:]
    assert lines(tmp_path, "second.trace")[1:]
    assert main(["run", str(path), "--set", "components.first.trace=none/first.trace"]) == 2
    error = (
        f"first: trace: {tmp_path}/none/first.trace: cannot be written: No such file or directory"
    )
    assert error in capsys.readouterr().err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="NO device that is always full")
def test_a_trace_for_which_there_is_no_room_is_an_error_in_one_line(tmp_path):
    system = traced_system(tmp_path, "2.0")
    first, second = system.components
    full = replace(system, components=(first, replace(second, trace=Path("/dev/full"))))
    with pytest.raises(InputError, match=r"^second: trace: /dev/full: cannot be written: No space"):
        simulate(full)


def test_what_has_no_trace_of_its_own_is_refused(tmp_path):
    system = System.load(system_file(tmp_path, "2.0", "", "none"))
    with pytest.raises(InputError, match=r"components.first.trace = 3: must be the path of a"):
        system.with_values({"components.first.trace": 3})
    both = {f"components.{name}.trace": "one" for name in ("first", "second")}
    with pytest.raises(InputError, match=r"second: trace: .*/one is that of first; must be anoth"):
        system.with_values(both)
    with pytest.raises(InputError, match=r"components.second.trace: is a file of one run"):
        sweep(traced_system(tmp_path, "2.0"), [{}])
