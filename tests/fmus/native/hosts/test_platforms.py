"""The grasp on other compilers and machines: the bits of Python, or nearly so, and the same states.

Where the libm is that of glibc, every bit is that of Python; elsewhere the loop stays close.
"""

import csv
import importlib.util
import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.base.c_compilers import LIBM
from grasp_cosim.fmu_export.build import build_native, planned
from grasp_cosim.fmu_export.native.targets import (
    KNOWN,
    LINUX_ARM,
    LINUX_X86,
    MAC_ARM,
    MAC_X86,
    WINDOWS,
    Target,
    this_target,
)
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.hil.served import Service
from grasp_cosim.ssp.to_archive import write_ssp
from support.c_host import Grasp, Host, Script, bits, good, number
from support.direct import BENCH, rows_in_python
from support.fmi2 import Fmu, Instance, read_members
from support.marks import needs_zig
from support.platforms import ARM, WIN, X86, Parts, Platform, cases, needs_programs, windows
from support.proxies import build_proxy, serving, wait_until

pytestmark = pytest.mark.platforms

H = 1e-3
CLOSE = 1e-12
"""How far the loop may be from that in Python at 10 kHz, where libm is another, at its end."""
ALWAYS_CLOSE = 1e-11
"""The same of positions, velocities and intensities at all times. One bit in an intensity is more
in its rate, and one in a position more in the force of a stiff contact, above all at an impact:"""
FORCES_CLOSE = 1e-9

PartsOf = Callable[[int], Parts]
PartsOn = Callable[[Platform, int], Parts]
HostFor = Callable[[Target], Host]


def run(host, grasp, folder, steps, h):
    (answers,) = host.run(grasp.whole(folder / "rows", steps, h), folder=folder)
    good(answers)
    return grasp.read(folder / "rows")


COLOURS = {"sensor_1.reflectance": 1.2, "sensor_2.reflectance": 0.3}
LOOPS = [
    ("GripperPlant", "GraspController", {}, 30_000, 1e-4),
    ("GripperPlant", "GraspController", BENCH, 30_000, 1e-4),
    ("GripperPlantCompliant", "GraspController", BENCH, 3000, 1e-4),
    ("GripperPlantMovable", "GraspController", BENCH, 10_000, 1e-4),
    ("GripperPlantMovable", "GraspController", BENCH, 3000, H),
    ("GripperPlant", "GraspControllerAdaptive", COLOURS, 3000, H),
]
"""Plant, controller, values, steps and their size."""


@cache
def in_python(loop):
    plant, controller, values, steps, h = LOOPS[loop]
    return rows_in_python(values, steps, h, plant=plant, controller=controller)


@pytest.mark.parametrize(("platform", "fmi"), [*cases(X86, [2]), *cases([*ARM, *WIN])])
def test_the_loop_on_other_platforms(platform, fmi, parts_on, host_for, tmp_path):
    """Every plant, with and without electronics and friction; both controllers."""
    host, made = host_for(platform.target), parts_on(platform, fmi)
    for loop, (plant, controller, values, steps, h) in enumerate(LOOPS):
        grasp = Grasp(made, values, plant, controller)
        found = run(host, grasp, tmp_path, steps, h)
        expected = in_python(loop)
        assert found.shape == expected.shape
        if platform.same_bits:
            assert np.array_equal(found.view(np.uint64), expected.view(np.uint64)), (plant, h)
            continue
        far = np.abs(found - expected)
        of_forces = ["force" in name for name in grasp.columns()]
        assert far.max() <= FORCES_CLOSE, (plant, h)
        if h == 1e-4:
            assert far[:, np.logical_not(of_forces)].max() <= ALWAYS_CLOSE, plant
            assert far[-1].max() <= CLOSE, plant


@pytest.mark.parametrize(("platform", "fmi"), cases([*ARM, *WIN]))
def test_a_state_goes_from_machine_to_machine_and_back(
    platform, fmi, parts_of, parts_on, host_for, tmp_path
):
    """As bytes, here, there, here again; the first bytes that there are made are those of here."""
    there = Grasp(parts_on(platform, fmi), BENCH)
    ours = Grasp(parts_of(fmi), BENCH)
    whole = run(host_for(this_target()), ours, tmp_path, 300, H)
    first, states = leg(host_for(this_target()), ours, tmp_path, None, 0)
    second, states = leg(host_for(platform.target), there, tmp_path, states, 100)
    third, _ = leg(host_for(this_target()), ours, tmp_path, states, 200)
    found = np.vstack([first[:-1], second[:-1], third])
    if platform.same_bits:
        assert np.array_equal(found.view(np.uint64), whole.view(np.uint64))
    np.testing.assert_allclose(found, whole, rtol=0.0, atol=FORCES_CLOSE)


def leg(host, grasp, folder, states, first):
    """Go on for 100 steps from the states, or begin; what was recorded, and the states then."""
    script = Script()
    grasp.load(script)
    grasp.make(script)
    if states is None:
        grasp.initialise(script)
    for i, data in enumerate(states or []):
        script.add("from", i, i, data).add("restore", i, i).add("bytes", i, i).add("forget", i, i)
    grasp.record(script, folder / "leg")
    script.add("loop", first, 100, bits(H))
    grasp.all_of(script, "save")
    grasp.all_of(script, "bytes")
    grasp.all_of(script, "forget")
    grasp.end(script)
    (answers,) = host.run(script, folder=folder)
    good(answers)
    written = [answer.found[0] for answer in answers if answer.command == "bytes"]
    assert written[: len(states or [])] == (states or [])
    return grasp.read(folder / "leg"), written[len(states or []) :]


ON_WINDOWS = needs_programs("wine")
ON_ARM = needs_programs("qemu-aarch64", "aarch64-linux-gnu-gcc")

STEPS = 50


@needs_zig
@pytest.mark.parametrize(
    ("target", "fmi", "place"),
    [
        pytest.param(WINDOWS, 2, "win64", marks=ON_WINDOWS),
        pytest.param(WINDOWS, 3, WINDOWS.tuple, marks=ON_WINDOWS),
        pytest.param(LINUX_ARM, 3, LINUX_ARM.tuple, marks=ON_ARM),
    ],
)
def test_steps_of_a_proxy(fmus, host_for, tmp_path, target, fmi, place):  # fmt: skip
    """To the bit what the FMU gives here."""
    original = fmus / "ProximitySensor.fmu"
    script = Script()
    with serving(original, Service(lockstep=True)) as server:
        options = ["--target", target.tuple, "--fmi", str(fmi)]
        path = build_proxy(original, tmp_path / "Bench.fmu", server.address[1], *options)
        fmu = Fmu(path, tmp_path / "unpacked")
        gap, intensity = fmu.references["gap"], fmu.references["intensity"]
        binary = fmu.folder / f"binaries/{place}/{fmu.name}{target.suffix}"
        script.add("load", 0, fmi, f"{'Z:' if target == WINDOWS else ''}{binary}")
        script.add("new", 0, 0, "full", "bench", fmu.guid, None)
        script.add("init", 0, bits(0.0)).add("leave", 0)
        for k in range(STEPS):
            script.add("set", 0, "real", gap, bits(0.01 + 1e-4 * k))
            script.add("step", 0, bits(k * H), bits(H))
            script.add("get", 0, "real", intensity)
        script.add("terminate", 0).add("free", 0)
        (answers,) = host_for(target).run(script, folder=tmp_path)
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)  # the end has no answer
        assert server.fmu.counters()["steps"] == STEPS
    assert [a for a in answers if a.status] == []
    found = [number(a.found[0]) for a in answers if a.command == "get"]
    with Instance(Fmu(original, tmp_path / "here")) as instance:
        instance.initialise()
        for k in range(STEPS):
            instance.set({"gap": 0.01 + 1e-4 * k})
            instance.step(k * H, H)
            assert instance.get("intensity") == [found[k]]


@needs_zig
@ON_WINDOWS
def test_a_peer_that_is_gone_on_windows(fmus, host_for, tmp_path):
    original = fmus / "ProximitySensor.fmu"
    with serving(original, Service(lockstep=True)) as server:
        port = server.address[1]
    options = ["--target", "win64"]
    fmu = Fmu(build_proxy(original, tmp_path / "B.fmu", port, *options), tmp_path / "u")
    script = Script().add("load", 0, 2, f"Z:{fmu.folder}/binaries/win64/{fmu.name}.dll")
    script.add("new", 0, 0, "full", "bench", fmu.guid, None)
    script.add("set", 0, "real", fmu.references["proxy.connect_timeout"], bits(0.2))
    script.add("init", 0, bits(0.0)).add("free", 0)
    (answers,) = host_for(WINDOWS).run(script, folder=tmp_path)
    assert [a.status for a in answers] == [0, 0, 0, 3, 0]
    ((_, _, _, said),) = answers[3].said
    assert f"no answer from 127.0.0.1:{port} within 0.2 s: is the peer running there" in said


NAMES = ("GraspController", "GripperPlant", "GripperPlantMovable", "ProximitySensor")


@pytest.fixture(scope="module")
def natives_of_windows(tmp_path_factory):
    """The folder of native FMUs that have a binary for Windows, too."""
    folder = tmp_path_factory.mktemp("windows")
    build_native(folder, planned([WINDOWS]), NAMES)
    return folder


def extracted(archive, folder):
    with ZipFile(archive) as file:
        file.extractall(folder)
    return folder


STEP = 1e-4
DIGITS = 0.6e-6
"""What ecos rounds to in its table, and a little."""

UNZIP = "@echo off\r\nxcopy /E /I /Y /Q %2.d %4\r\n"
"""Where SHELL is bash, ecos calls unzip, which wine lacks: this copies what was unpacked before."""

SAMPLED = ("plant.", "controller.target_position", "controller.virtual_position")
"""What a master that steps all at once has at the same points as ours."""


@needs_zig
@ON_WINDOWS
@pytest.mark.skipif(not importlib.util.find_spec("ecospy"), reason="NO ecospy")
def test_ecos_runs_the_grasp(natives_of_windows, tmp_path):
    system = (
        System.load(SYSTEM, natives_of_windows)
        .with_experiment(STEP, scheme="jacobi")
        .with_values({"plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.86})
    )
    path = tmp_path / "grasp.ssp"
    write_ssp(system, path)
    folder = extracted(path, tmp_path / "grasp.ssp.d")
    for fmu in [*folder.glob("resources/*.fmu")]:
        extracted(fmu, fmu.with_name(f"{fmu.name}.d"))
    (tmp_path / "unzip.bat").write_bytes(UNZIP.encode())
    spec = importlib.util.find_spec("ecospy")
    assert spec is not None
    assert spec.origin is not None
    program = Path(spec.origin).with_name("binaries") / "ecos.exe"
    options = ["--stopTime", "3", "--stepSize", repr(STEP), "--parameterSet", "initialValues"]
    done = subprocess.run(
        ["wine", program, "simulate", "--path", f"Z:{path}", *options],
        cwd=tmp_path, env=windows() | {"SHELL": "/bin/bash"}, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    theirs = table(tmp_path / "grasp.csv")
    ours = simulate(system)
    names = [name for name in ours.units if name.startswith(SAMPLED) and name in theirs]
    assert len(names) > 12
    for name in names:
        found = np.asarray(ours[name], dtype=np.float64)[: len(theirs[name])]
        assert np.max(np.abs(theirs[name] - found)) <= DIGITS, name
    assert {len(column) for column in theirs.values()} == {30_000}
    assert theirs["plant.contact[1]"][-1] == theirs["plant.contact[2]"][-1] == 1.0


def table(path):
    """The columns of a table of ecos, by our names of variables."""
    with path.open(newline="") as file:
        head, *rows = csv.reader(file, skipinitialspace=True)
    columns = np.array([row[2:] for row in rows], dtype=np.float64).T
    names = [name.rpartition("[")[0].replace("::", ".") for name in head[2:]]
    return dict(zip(names, columns, strict=True))


NAME = "ProximitySensor"
"""Of all blocks the one that calls most."""

FUNCTIONS = {
    *LIBM, "ceil", "copysign", "fabs", "floor", "sqrt",
    "memcmp", "memcpy", "memmove", "memset",
    "strcat", "strchr", "strcmp", "strcpy", "strcspn", "strlen", "strncmp",
    "calloc", "free", "malloc",
}  # fmt: skip
"""No file, no time, no environment, no output: mathematics, bytes, and memory of the start."""

OF_THE_LINKER = {
    "_ITM_deregisterTMCloneTable",
    "_ITM_registerTMCloneTable",
    "__gmon_start__",
    "__cxa_finalize",
}
IN_WINDOWS = re.compile(r"KERNEL32\.dll|ntdll\.dll|api-ms-win-crt-[a-z]+-l1-1-0\.dll")
"""Parts of every Windows since 10."""

needs_objdump = pytest.mark.skipif(not shutil.which("objdump"), reason="NO objdump")


@pytest.fixture(scope="module")
def binaries(tmp_path_factory):
    """One FMU for all platforms, its binaries by target."""
    folder = tmp_path_factory.mktemp("all")
    (built,) = build_native(folder, planned(KNOWN, fmi=3), [NAME])
    members = read_members(built.path)
    files = {}
    for target in KNOWN:
        files[target] = folder / f"{target.tuple}{target.suffix}"
        place = f"binaries/{target.tuple}/{NAME}{target.suffix}"
        files[target].write_bytes(members[place])
    assert {n for n in members if n.startswith("binaries/")} == {
        f"binaries/{t.tuple}/{NAME}{t.suffix}" for t in KNOWN
    }
    return files


def said(*command):
    return subprocess.check_output([str(word) for word in command], text=True)


@needs_zig
@needs_objdump
@pytest.mark.parametrize("target", [LINUX_X86, LINUX_ARM])
def test_on_linux(binaries, target):
    dynamic = said("readelf", "--wide", "--dynamic", binaries[target])
    assert {*re.findall(r"NEEDED.*\[(.*)\]", dynamic)} <= {"libc.so.6", "libm.so.6"}
    symbols = said("readelf", "--wide", "--dyn-syms", binaries[target])
    asked = {*re.findall(r" UND (\w+)", symbols)} - OF_THE_LINKER
    assert asked
    assert asked <= FUNCTIONS
    versions = [tuple(map(int, v.split("."))) for v in re.findall(r"GLIBC_([\d.]+)", symbols)]
    assert max(versions) <= (2, 17)
    assert {*re.findall(r" (?:DEFAULT|PROTECTED) +\d+ (\w+)", symbols)} == standard_functions(3)


@needs_zig
@needs_objdump
def test_on_windows(binaries):
    text = said("objdump", "-p", binaries[WINDOWS])
    libraries = re.findall(r"DLL Name: (\S+)", text)
    assert libraries
    assert [name for name in libraries if not IN_WINDOWS.fullmatch(name)] == []
    exported = {*re.findall(r"^\s+\[ *\d+\] (?:\+base\[ *\d+\] +[0-9a-f]+ )?(fmi\w+)$", text, re.M)}
    assert exported == standard_functions(3)


@needs_zig
@needs_objdump
@pytest.mark.parametrize("target", [MAC_X86, MAC_ARM])
def test_on_macos(binaries, target):
    assert [*loaded_by_mach_o(binaries[target].read_bytes())] == ["/usr/lib/libSystem.B.dylib"]


def loaded_by_mach_o(data):
    """The libraries that it names in commands of the kind LC_LOAD_DYLIB."""
    magic, _, _, _, count = struct.unpack_from("<5I", data)
    assert magic == 0xFEEDFACF
    place = 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", data, place)
        if kind == 0xC:
            (at,) = struct.unpack_from("<I", data, place + 8)
            yield data[place + at : place + size].split(b"\0")[0].decode()
        place += size


def standard_functions(fmi):
    """Those that the standard's header declares."""
    headers = Path(fmpy.__file__).parent / "c-code"
    text = (headers / f"fmi{fmi}FunctionTypes.h").read_text()
    return {*re.findall(rf"\b(fmi{fmi}\w+)TYPE\b", text)}


@needs_zig
@needs_objdump
def test_one_dylib_serves_both_processors_in_fmi_2(tmp_path):
    (built,) = build_native(tmp_path, planned([MAC_X86, MAC_ARM]), [NAME])
    data = read_members(built.path)[f"binaries/darwin64/{NAME}.dylib"]
    magic, count = struct.unpack_from(">II", data)
    assert (magic, count) == (0xCAFEBABE, 2)
    for i in range(2):
        _, _, place, size, _ = struct.unpack_from(">5I", data, 8 + 20 * i)
        assert [*loaded_by_mach_o(data[place : place + size])] == ["/usr/lib/libSystem.B.dylib"]
