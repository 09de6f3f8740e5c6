"""The grasp of native FMUs in a host in C: what the blocks give in Python, to the bit.

Also when it goes back, starts again, loads again, in threads, with a decimal comma, and whatever
the host leaves out.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from grasp_fmus.native.targets import here
from support.c_host import BENCH, Grasp, Host, Part, Script, bits, good, rows_in_python
from support.marks import platforms, slow
from support.platforms import host_of

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")

H = 1e-3
STEPS = 200
PLANTS = ("GripperPlant", "GripperPlantCompliant", "GripperPlantMovable")


def same_bits(found, expected):
    assert found.shape == expected.shape
    assert np.array_equal(found.view(np.uint64), expected.view(np.uint64))


def rows(host, grasp, script, path, **environment):
    """What a script that records gives; it must be all well."""
    (answers,) = host.run(script, folder=path.parent, **environment)
    good(answers)
    return grasp.read(path)


@pytest.fixture
def grasp(parts):
    return Grasp(parts, BENCH)


@pytest.fixture
def expected(grasp, host, tmp_path):
    """A whole run of STEPS steps."""
    path = tmp_path / "expected"
    return rows(host, grasp, grasp.whole(path, STEPS, H), path)


def started(grasp, **how):
    script = Script()
    grasp.load(script)
    grasp.make(script, **how)
    grasp.initialise(script)
    return script


@pytest.mark.parametrize(
    ("steps", "h", "plant", "values"),
    [
        (3000, 1e-3, "GripperPlant", BENCH),
        *(slow(3000, 1e-3, plant, values) for plant in PLANTS for values in ({}, BENCH)),
        slow(30_000, 1e-4, "GripperPlantMovable", BENCH),
        slow(300, 0.01, "GripperPlantCompliant", BENCH),
    ],
)
def test_the_loop_is_that_of_the_blocks_to_the_bit(parts, host, tmp_path, steps, h, plant, values):
    grasp = Grasp(parts, values, plant)
    found = rows(host, grasp, grasp.whole(tmp_path / "rows", steps, h), tmp_path / "rows")
    same_bits(found, rows_in_python(values, steps, h, plant))
    assert len(np.unique(found[:, 0])) > 10  # it moves


def test_back_by_a_state_and_on_again_also_in_another_process(grasp, expected, host, tmp_path):
    """By its bytes, in instances that were made for something else, as FMI lets them."""
    script = started(grasp)
    grasp.record(script, tmp_path / "rows")
    script.add("loop", 0, 50, bits(H))
    grasp.all_of(script, "save")
    grasp.all_of(script, "bytes")
    script.add("loop", 50, 100, bits(H))
    grasp.all_of(script, "restore")
    script.add("loop", 50, 150, bits(H))
    grasp.all_of(script, "forget")
    grasp.end(script)
    (answers,) = host.run(script, folder=tmp_path)
    good(answers)
    same_bits(grasp.read(tmp_path / "rows"), np.vstack([expected[:151], expected[51:]]))
    saved = [answer.found[0] for answer in answers if answer.command == "bytes"]
    script = started(Grasp({part.fmu.name: part for part in grasp.parts.values()}))
    for i, data in enumerate(saved):
        script.add("from", i, i, data).add("restore", i, i).add("forget", i, i)
    grasp.record(script, tmp_path / "second")
    script.add("loop", 50, 150, bits(H))
    grasp.end(script)
    same_bits(rows(host, grasp, script, tmp_path / "second"), expected[50:])


def test_again_by_a_reset_and_by_loading_again(grasp, expected, host, tmp_path):
    """As in a fast restart, in the middle of a run; then in the same process, as if new."""
    script = started(grasp)
    grasp.record(script, tmp_path / "first")
    script.add("loop", 0, 50, bits(H))
    for i in grasp.index.values():
        script.add("reset", i)
    grasp.initialise(script)
    for life in ("second", "third"):
        script.add("rows", tmp_path / life).add("row").add("loop", 0, STEPS, bits(H))
        grasp.end(script)
        grasp.unload(script)
        if life == "second":
            grasp.load(script)
            grasp.make(script)
            grasp.initialise(script)
    same_bits(rows(host, grasp, script, tmp_path / "second"), expected)
    same_bits(grasp.read(tmp_path / "third"), expected)


@pytest.mark.parametrize(
    ("callbacks", "resources"),
    [("own", None), ("mute", ""), ("bare", "http://localhost/x"), ("none", "/x" * 5000)],
    ids=["own", "mute", "bare", "none"],
)
def test_whatever_callbacks_and_place_the_host_has(
    callbacks, resources, grasp, expected, host, tmp_path
):
    """Memory of its own, which must come back to it; no logger; none at all. Refusals included."""
    script = started(grasp, callbacks=callbacks, resources=resources)
    grasp.record(script, tmp_path / "rows")
    for i in grasp.index.values():
        script.add("step", i, bits(9.0), bits(H)).add("set", i, "real", 10**6, bits(1.0))
    grasp.all_of(script, "save")
    script.add("loop", 0, STEPS, bits(H))
    grasp.all_of(script, "forget")
    grasp.end(script)
    (answers,) = host.run(script, folder=tmp_path)
    wrong = [answer for answer in answers if answer.status]
    assert [(a.command, a.status) for a in wrong] == [("step", 3), ("set", 3)] * 4
    assert all(bool(a.said) == (callbacks == "own") for a in wrong)
    same_bits(grasp.read(tmp_path / "rows"), expected)


def german(folder):
    """An environment with a locale that has a decimal comma, made for the purpose."""
    if not shutil.which("localedef") or not Path("/usr/share/i18n/locales/de_DE").exists():
        pytest.skip("NO localedef, or no definition of de_DE: in the package locales")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
    subprocess.run(command, check=True, capture_output=True)
    return {"LOCPATH": str(folder)}


@pytest.mark.slow
def test_where_a_decimal_point_is_a_comma(grasp, expected, host, tmp_path):
    environment = german(tmp_path)
    script = Script().add("locale", "de_DE.UTF-8")
    grasp.load(script)
    grasp.make(script)
    grasp.initialise(script)
    grasp.record(script, tmp_path / "rows")
    script.add("loop", 0, STEPS, bits(H))
    plant = grasp.parts["plant"].fmu.references["object_width"]
    script.add("step", 0, bits(9.25), bits(0.125)).add("set", 0, "real", plant, bits(0.5))
    (answers,) = host.run(script, folder=tmp_path, **environment)
    good(answers[:-2])
    ((_, _, _, text),) = answers[-2].said
    assert text == "plant, t = 0.2 s: step from 9.25 s: must be from 0.2 s"
    same_bits(grasp.read(tmp_path / "rows"), expected)


def test_memory_is_asked_for_at_the_start_and_for_states_alone(grasp, tmp_path):
    """Counted in malloc itself: a real-time target needs it so. Refusals ask for none, either."""
    host = host_of(here(), tmp_path, ["-DCOUNT_ALLOCATIONS"])
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
    everything(_sanitized(parts, tmp_path), host_of(here(), tmp_path, SANITIZERS), tmp_path)


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
