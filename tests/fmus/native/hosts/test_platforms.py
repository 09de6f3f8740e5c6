"""The grasp on other compilers and machines: the bits of Python, or nearly so, and the same states.

Where the libm is that of glibc, every bit is that of Python; elsewhere the loop stays close.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from grasp_fmus.native.targets import Target, here
from support.c_host import BENCH, Grasp, Host, Script, bits, good, rows_in_python
from support.platforms import ARM, WIN, X86, Parts, Platform, cases

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
    return rows_in_python(values, steps, h, plant, controller)


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
    whole = run(host_for(here()), ours, tmp_path, 300, H)
    first, states = leg(host_for(here()), ours, tmp_path, None, 0)
    second, states = leg(host_for(platform.target), there, tmp_path, states, 100)
    third, _ = leg(host_for(here()), ours, tmp_path, states, 200)
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
