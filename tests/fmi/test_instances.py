"""Instances of native FMUs of both versions, here and in processes of their own."""

import ctypes
import math
import os
import re
import subprocess
import sys
import tempfile
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import fmpy.fmi1
import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.fmi.co_simulation import SharedInstance
from grasp_cosim.fmi.fmi2_logger import CONVENTION, formatted, logger_type
from grasp_cosim.fmi.instance import DISCARD, OK, Inputs, dtype
from grasp_cosim.fmi.load import load, load_here
from grasp_cosim.interface.obstacles import this_platform
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.variables import Variable
from grasp_cosim.system.parts import Component, Connection, Port
from support.compiled import shared_library
from support.marks import engines, slow
from support.native_fmus import CAPABLE, EVENT_MODE, TYPES, build, needs_gcc, starts

KINDS = [("2.0", "none"), slow("2.0", "process"), ("3.0", "none"), ("3.0", "process")]
"""Every version, in this process and in one of its own."""

SAMPLES = {
    "Real": -1.25e-300, "Integer": -(2**31), "Float64": -1.25e-300, "Float32": 0.15625,
    "Int8": -128, "UInt8": 255, "Int16": -(2**15), "UInt16": 2**16 - 1, "Int32": -(2**31),
    "UInt32": 2**32 - 1, "Int64": -(2**63), "UInt64": 2**64 - 1, "Boolean": True,
    "Enumeration": 2, "String": "Grüße \N{SNOWMAN}",
}  # fmt: skip
"""A value by type, at the edge of what it holds where that has one."""


@contextmanager
def running(folder, version, isolation="none", values=None, capabilities=None):
    """An initialised instance named 'part' of the native FMU."""
    fmu = build(folder, version=version, capabilities=capabilities)
    instance = load(Component("part", fmu, {}, isolation=isolation))
    try:
        instance.enter_initialization(values or {}, 10.0)
        instance.exit_initialization()
        yield instance
    finally:
        instance.close()


class Bound:
    """The calls of an instance as a plan binds them, on buffers of its own."""

    def __init__(self, instance, step):
        self.instance = instance
        self.clock = np.zeros(3)
        self.step = instance.stepper(self.clock, step).python

    def exchange(self, action, *names):
        """The call that sets or gets the variables, and the buffer."""
        variables = [self.instance.interface.by_name[name] for name in names]
        data = np.zeros(len(names), dtype(self.instance.interface.version, variables[0].type))
        return self.instance.transfer(action, variables, data).python, data


def variable(instance, name):
    """The declared variable of that name."""
    return instance.interface.by_name[name]


def real(version):
    """The double precision type of a version."""
    return next(iter(TYPES[version]))


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


@pytest.mark.parametrize("lacks", ["hasEventMode", "canHandleVariableCommunicationStepSize"])
def test_a_step_ends_early_only_with_event_mode_and_where_its_length_may_vary(tmp_path, lacks):
    fixed = {**EVENT_MODE, lacks: "false"}
    with running(tmp_path, "3.0", values={"early_at": 0.1}, capabilities=fixed) as part:
        assert Bound(part, 0.2).step() == OK


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


@contextmanager
def shared(fmu, name, **values):
    instance = load(Component(name, fmu, {}, native=fmu))
    assert isinstance(instance, SharedInstance)
    try:
        instance.enter_initialization(values, 10.0)
        instance.exit_initialization()
        yield instance
    finally:
        instance.close()


def steps(instance, count):
    bound = Bound(instance, 1.0)
    for k in range(count):
        bound.clock[0] = float(k)
        assert bound.step() == OK
    (x,) = instance.get([variable(instance, "x")])
    assert isinstance(x, float)
    return x


def test_two_at_once_have_values_of_their_own(tmp_path):
    fmu = build(tmp_path, version="2.0")
    with shared(fmu, "a", u_Real=1.0) as a, shared(fmu, "b", u_Real=10.0, gain=2.0) as b:
        assert (steps(a, 3), steps(b, 2)) == (3.0, 40.0)
        assert a._slave.component != b._slave.component


def test_one_after_the_other_starts_anew_from_the_same_files(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    fmu = build(tmp_path, version="2.0")
    extracted = []
    for _ in range(3):
        with shared(fmu, "a", u_Real=1.0) as a:
            assert steps(a, 2) == 2.0
            extracted.append(a._slave.unzipDirectory)
    assert len(set(extracted)) == 1
    assert [f.name for f in tmp_path.iterdir() if f.is_dir()] == [Path(extracted[0]).name]


def test_an_fmu_that_was_built_anew_is_loaded_anew(tmp_path):
    with shared(build(tmp_path, version="2.0"), "a") as a:
        before = a._slave.unzipDirectory
    fmu = build(tmp_path, version="2.0")
    os.utime(fmu, ns=(1, 1))
    with shared(fmu, "a") as a:
        assert a._slave.unzipDirectory != before


def test_in_a_process_of_its_own_and_of_fmi_3_it_is_loaded_as_any_other(tmp_path):
    kinds = [("2.0", "process"), ("3.0", "none")]
    for version, isolation in kinds:
        fmu = build(tmp_path, version=version)
        instance = load(Component("a", fmu, {}, isolation=isolation, native=fmu))
        assert not isinstance(instance, SharedInstance)
        instance.close()


# Whole runs: steps that are rejected, inputs that a failure names

DISCARDED = (
    r"^part: native.fmu returned discard at t = 0.3 s: the step is too long "
    r"\(inputs: u_\w+ = 2, .*\)(\n|$)"
)


def alone(folder, version, isolation, **values):
    """A native FMU that integrates 2.0 for a second in steps of 0.1 s."""
    fmu = build(folder, version=version, capabilities=CAPABLE if version == "2.0" else EVENT_MODE)
    given = {**starts(version), f"u_{real(version)}": 2.0, **values}
    component = Component("part", fmu, given, isolation=isolation)
    return System("alone", (component,), (), 100_000_000, 1_000_000_000, "sequential")


@both
@engines
@pytest.mark.parametrize("parameter", ["early_at", "discard_at"])
def test_a_rejected_step_is_taken_in_parts(tmp_path, version, isolation, engine, parameter):
    """The integral of a constant does not depend on how the step is divided."""
    result = simulate(alone(tmp_path, version, isolation, **{parameter: 0.35}), engine=engine)
    assert result.complete
    assert result["part.x"] == pytest.approx(2.0 * result.time, rel=1e-13, abs=1e-15)
    rejection = result.rejections["part"]
    assert (rejection.count, rejection.first) == (1, 0.3)
    assert result["part.steps"][-1] == 11  # of two parts each
    assert result["part.now"][-1] == pytest.approx(1.0, rel=1e-15)


@both
@engines
def test_a_wish_to_end_ends_the_run_in_good_order(tmp_path, version, isolation, engine):
    """The last row is that of the communication point behind it."""
    result = simulate(alone(tmp_path, version, isolation, terminate_at=0.35), engine=engine)
    assert (result.complete, result.ended_at) == (False, 0.4)
    assert result["part.x"] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.7], rel=1e-13)
    assert result.log[-1] == (
        "part asked for the end of the simulation at t = 0.35 s; its values there are in the last "
        "row, that of t = 0.4 s"
    )
    assert not result.rejections


def test_a_wish_to_end_in_a_part_of_a_step(tmp_path):
    result = simulate(alone(tmp_path, "2.0", "none", early_at=0.32, terminate_at=0.37))
    assert (result.complete, result.ended_at) == (False, 0.4)
    assert result["part.x"][-1] == pytest.approx(0.74, rel=1e-13)
    assert "at t = 0.37 s" in result.log[-1]


@both
def test_a_step_that_no_part_of_can_be_taken_ends_the_run(tmp_path, version, isolation):
    """A step is halved at most ten times; so close to its start none of them is short enough."""
    system = alone(tmp_path, version, isolation, discard_at=0.3 + 1e-6)
    with pytest.raises(SimulationError, match=DISCARDED) as caught:
        simulate(system)
    assert len(caught.value.__notes__) == 11


def declared(name, kind="Real", causality="input", **more):
    given = {"unit": None, "start": None, "minimum": None, "maximum": None, **more}
    return Variable(name, kind, causality, 1, **given)  # type: ignore[arg-type]


def test_of_many_those_that_are_out_of_range_come_first():
    inputs = Inputs()
    for i in range(20):
        inputs.set(declared(f"u[{i}]", minimum=0.0), float(i))
    inputs.set(declared("far", minimum=0.0, maximum=1.0), 2.0)
    inputs.set(declared("broken"), math.nan)
    assert str(inputs) == (
        " (inputs: far = 2, broken = nan, u[0] = 0, u[1] = 1, u[2] = 2, u[3] = 3, ... (16 more))"
    )


@pytest.mark.parametrize(("version", "isolation"), KINDS)
@engines
def test_a_failing_step_names_what_came_over_its_connections(tmp_path, version, isolation, engine):
    """Under the system's name, after the factor of the connection."""
    u, y = f"u_{real(version)}", f"y_{real(version)}"
    others = starts(version)
    others.pop(u)
    fmu = build(tmp_path, version=version, units={u: "mm", y: "m"})
    system = System(
        "two",
        (
            Component("first", fmu, {u: 1.5, **others}),
            Component("second", fmu, {"error_at": 1.05, **others}, {"width": u}, None, isolation),
        ),
        (Connection(Port("first", y), Port("second", "width")),),
        100_000_000,
        2_000_000_000,
        "sequential",
    )
    with pytest.raises(SimulationError) as caught:
        simulate(system, engine=engine)  # type: ignore[arg-type]
    head, _, inputs = str(caught.value).partition(" (inputs: ")
    assert head.startswith("second: native.fmu returned error at t = 1 s")
    assert inputs.startswith("width = 1500 mm, u_")


# Messages of FMI 2.0: a format with its arguments, as C passes and prints them

here = pytest.mark.skipif(CONVENTION is None, reason="NO va_list of this processor is known")

C = """
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
char wanted[50][1000];
int said;
#define SAY(...) do { \\
    snprintf(wanted[said++], 1000, __VA_ARGS__); log(0, "part", 3, "why", __VA_ARGS__); \\
} while (0)
void say(logger log) {
    SAY("none");
    SAY("100 %% of it");
    SAY("the %s is broken", "lamp");
    SAY("%d %i %u %x %#X %o %c %p", -1, 2, 3u, 0xabc, 0xABC, 8, 'c', (void *)wanted);
    SAY("%ld %lld %zu %hd %hhd %jd %td %lu", -1L, -2LL, (size_t)3, (short)-4, (signed char)-5,
        (intmax_t)6, (ptrdiff_t)7, ~0UL);
    SAY("%f %e %g %G %a %g", 1.5, -2.5e300, 0.1, 1e-7, 3.0, 1.0 / 0.0);
    SAY("%5d|%-8s|%08.3f|%+d|%.*f|%*d|%.3s", 42, "ab", 3.14159, 7, 2, 2.71828, 6, 9, "abcdef");
    SAY("%2$s %1$d", 5, "second");
    SAY("%d %d %d %d %d %d %d %d %d %d %d %d", 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12);
    SAY("%g %g %g %g %g %g %g %g %g %g %g %g %s",
        1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., "end");
    SAY("%g %d %g %s %g %d %g %s %g %d %g %s %g %d %g %s %g %d %g %s %g %d",
        1., 1, 2., "a", 3., 2, 4., "b", 5., 3, 6., "c", 7., 4, 8., "d", 9., 5, 10., "e", 11., 6);
}
"""


def said(library):
    """What the logger made of all that is said, and what C's own printf did."""
    found = []

    def log(environment, name, status, why, form, *passed):
        assert (environment, name, status, why) == (None, b"part", 3, b"why")
        found.append(formatted(form, passed))

    logger = logger_type()(log)
    library.say(logger)
    wanted = (ctypes.c_char * 1000 * 50).in_dll(library, "wanted")
    return found, [text.value for text in wanted[: len(found)]]


@needs_gcc
@here
@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_arguments_are_printed_as_by_c(tmp_path, level):
    file = tmp_path / "say.so"
    file.write_bytes(shared_library(code=C, options=(level,)))
    found, wanted = said(ctypes.CDLL(str(file)))
    assert found == wanted
    assert found[2] == b"the lamp is broken"
    assert len(found) == 11


@needs_gcc
@here
@pytest.mark.parametrize("form", ["%Lf, %d", "%.3Lg", "%d " * 33])
def test_what_cannot_be_told_stays_as_it_comes(tmp_path, form):
    begin, end = C.split("    SAY", 1)[0], f'log(0, "part", 3, "why", "{form}", 1.0L, 5); }}'
    file = tmp_path / "say.so"
    file.write_bytes(shared_library(code=begin + end))
    assert said(ctypes.CDLL(str(file)))[0] == [form.encode()]


def test_fmpys_own_logger_is_not_used_and_what_it_prints_is_not_seen():
    """Where FMPy has none for a processor, it says so on standard output."""
    code = """
import sys, types
sys.modules["fmpy.logging"] = logging = types.ModuleType("fmpy.logging")
logging.addLoggerProxy = lambda _: print("none such") or print("asked", file=sys.stderr)
import grasp_cosim.fmi.co_simulation
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    assert (done.stdout, done.stderr.split()) == (b"", [b"asked"] * 2)  # by FMPy: FMI 1.0 and 2.0


@needs_gcc
def test_threads_that_load_fmus_together_keep_the_current_folder(tmp_path, monkeypatch):
    """FMPy goes to the folder of a library for the time of loading it, and all threads with it."""
    load_library = fmpy.fmi1.cdll.LoadLibrary

    def slowly(path):
        time.sleep(0.01)
        return load_library(path)

    monkeypatch.setattr(fmpy.fmi1.cdll, "LoadLibrary", slowly)
    monkeypatch.chdir(tmp_path)
    fmu = build(tmp_path, version="2.0")

    def life(_):
        load(Component("part", fmu, {})).close()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(life, range(12)))
    assert Path.cwd() == tmp_path


@pytest.mark.parametrize("capabilities", [CAPABLE, {**CAPABLE, "canGetAndSetFMUState": "true"}])
def test_the_states_of_an_fmu_of_others_are_not_known_one_by_one(tmp_path, capabilities):
    fmu = build(tmp_path, capabilities=capabilities)
    instance = load_here("part", read_interface(fmu))
    said = r"^part: the states of native\.fmu are not known one by one; must be an FMU that grasp-c"
    try:
        with pytest.raises(InputError, match=said):
            instance.numbers()
        with pytest.raises(InputError, match=said):
            instance.take_numbers(np.zeros(1))
    finally:
        instance.close()
