"""The grasp of native FMUs in a host in C: what the blocks give in Python, to the bit.

Also with a decimal comma, and under what finds errors of memory.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.fmu_export.native.targets import this_target
from support.c_host import Grasp, Host, Part, Script, bits, good
from support.direct import BENCH, rows_in_python
from support.marks import platforms, slow
from support.platforms import host_of

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")

H = 1e-3
PLANTS = (
    "GripperPlant",
    "GripperPlantCompliant",
    "GripperPlantDelicate",
    "GripperPlantMovable",
)
LIFT = {
    "plant.initial_object_position": 0.02,
    "plant.pad.stiffness": 4000.0,
    "plant.pad.thickness": 0.002,
    "plant.object_mass": 0.35,
    "plant.object_height": 0.01,
    "plant.impulse_limit": 0.01,
    "plant.lift.enabled": True,
    "plant.lift.time": 2.3,
}
"""A grasp that is lifted, slips and is dropped."""


def same_bits(found, expected):
    assert found.shape == expected.shape
    assert np.array_equal(found.view(np.uint64), expected.view(np.uint64))


@pytest.fixture
def grasp(parts):
    return Grasp(parts, BENCH)


def started(grasp, script=None):
    script = script or Script()
    grasp.load(script)
    grasp.make(script)
    grasp.initialise(script)
    return script


@pytest.mark.parametrize(
    ("steps", "h", "plant", "values"),
    [
        (3000, 1e-3, "GripperPlant", BENCH),
        *(slow(3000, 1e-3, plant, values) for plant in PLANTS for values in ({}, BENCH)),
        slow(30_000, 1e-4, "GripperPlantMovable", BENCH),
        slow(300, 0.01, "GripperPlantCompliant", BENCH),
        (3000, 1e-3, "GripperPlantDelicate", LIFT),
    ],
)
def test_the_loop_is_that_of_the_blocks_to_the_bit(parts, host, tmp_path, steps, h, plant, values):
    grasp = Grasp(parts, values, plant)
    (answers,) = host.run(grasp.whole(tmp_path / "rows", steps, h), folder=tmp_path)
    good(answers)
    found = grasp.read(tmp_path / "rows")
    same_bits(found, rows_in_python(values, steps, h, plant=plant))
    assert len(np.unique(found[:, 0])) > 10  # it moves


@pytest.mark.slow
def test_where_a_decimal_point_is_a_comma(grasp, host, tmp_path):
    if not shutil.which("localedef") or not Path("/usr/share/i18n/locales/de_DE").exists():
        pytest.skip("NO localedef, or no definition of de_DE: in the package locales")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")]
    subprocess.run(command, check=True, capture_output=True)
    script = started(grasp, Script().add("locale", "de_DE.UTF-8"))
    grasp.record(script, tmp_path / "rows")
    script.add("loop", 0, 200, bits(H)).add("step", 0, bits(9.25), bits(0.125))
    (answers,) = host.run(script, folder=tmp_path, LOCPATH=str(tmp_path))
    good(answers[:-1])
    ((_, _, _, text),) = answers[-1].said
    assert text == "plant, t = 0.2 s: step from 9.25 s: must be from 0.2 s"
    same_bits(grasp.read(tmp_path / "rows"), rows_in_python(BENCH, 200, H))


def test_memory_is_asked_for_at_the_start_and_for_states_alone(grasp, tmp_path):
    """Counted in malloc itself: a real-time target needs it so. Refusals ask for none, either."""
    host = host_of(this_target(), tmp_path, ["-DCOUNT_ALLOCATIONS"])
    script = started(grasp)
    grasp.record(script, tmp_path / "rows")
    script.add("memory").add("loop", 0, 20, bits(H)).add("memory").add("loop", 20, 1000, bits(H))
    for i in grasp.index.values():
        script.add("step", i, bits(9.0), bits(H)).add("set", i, "real", 0, bits(float("nan")))
        script.add("get", i, "real", 0)
    script.add("memory")
    grasp.all_of(script, "save")
    script.add("memory")
    for _ in range(5):
        grasp.all_of(script, "save")
        grasp.all_of(script, "restore")
        grasp.all_of(script, "bytes")
    script.add("memory")
    grasp.end(script)
    (answers,) = host.run(script, folder=tmp_path)
    start, first, loop, saved, again = (
        int(a.found[0]) for a in answers if a.command == "memory"
    )  # fmt: skip
    assert start > len(grasp.parts)  # it counts
    assert (first - start, loop - first, saved - loop, again - saved) == (0, 0, 4, 0)


fmi_2_first = pytest.mark.parametrize(
    "parts", [2, platforms(3)], ids=["FMI 2", "FMI 3"], indirect=True
)
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


@pytest.mark.slow
@fmi_2_first
def test_sanitizers_find_nothing(parts, tmp_path):
    everything(_sanitized(parts, tmp_path), host_of(this_target(), tmp_path, SANITIZERS), tmp_path)


def _sanitized(parts, folder):
    made = {}
    for name, part in parts.items():
        fmu, library = part.fmu, folder / f"{name}.so"
        defined = f"-DFMI{fmu.fmi}_OVERRIDE_FUNCTION_PREFIX"
        subprocess.run(
            ["gcc", "-std=c99", "-g", "-O1", "-ffp-contract=off", *SANITIZERS, "-fPIC", "-shared",
             defined, f"{name}.c", "-lm", "-o", str(library)],
            cwd=fmu.folder / "sources", check=True,
        )  # fmt: skip
        made[name] = Part(fmu, library)
    return made


@pytest.mark.slow
@fmi_2_first
@pytest.mark.skipif(not shutil.which("valgrind"), reason="NO valgrind")
def test_valgrind_finds_nothing(parts, host, tmp_path):
    """No error, and nothing that was not freed."""
    options = ["-q", "--leak-check=full", "--show-leak-kinds=all", "--error-exitcode=99"]
    everything(parts, Host(host.program, ("valgrind", *options)), tmp_path)


def everything(parts, host, folder):
    """A run with refusals, discards, states and two lives."""
    for plant in PLANTS:
        grasp = Grasp(parts, BENCH, plant)
        script = Script()
        for life in range(2):
            grasp.load(script)
            grasp.make(script, callbacks=("full", "own")[life])
            grasp.initialise(script)
            if life == 0:
                grasp.record(script, folder / "rows")
            script.add("loop", 0, 100, bits(H))
            grasp.all_of(script, "save")
            grasp.all_of(script, "bytes")
            for i in grasp.index.values():
                script.add("from", i, 9, "00" * 200).add("from", i, 10, "")
                script.add("step", i, bits(9.0), bits(H)).add("set", i, "real", 0, bits(1e308 * 10))
                script.add("get", i, "real", 10**9).add("set", i, "boolean", 0, bits(1.0))
                script.add("step", i, bits(0.1), bits(1e300)).add("last", i)
                script.add("set", i, "real", 0, bits(1e300)).add("step", i, bits(0.1), bits(1e-3))
            grasp.all_of(script, "restore")
            script.add("loop", 100, 100, bits(H))
            grasp.all_of(script, "forget")
            for i in grasp.index.values():
                script.add("reset", i)
            grasp.end(script)
            grasp.unload(script)
        (answers,) = host.run(script, folder=folder)
        loops = [a.status for a in answers if a.command in ("loop", "restore", "forget", "unload")]
        assert set(loops) == {0}
        assert {a.status for a in answers} >= {0, 2, 3}
