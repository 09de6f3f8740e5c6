"""The outputs of a system itself are those of its components in their own units, row by row."""

import numpy as np
import pytest
from grasp_cosim import System
from grasp_cosim.exchange.dispatch import Dispatcher
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.system.parts import Port
from ssp.hand_made import archive, component, connect, fmu, structure, system


def recorded(loaded, slots, rows):
    """The signals and their columns of rows of values that go on whatever they are."""
    memory, system = MemoryListener(), loaded.with_experiment(0.1, 0.5, diverging="continue")
    dispatcher = Dispatcher(system, slots, [memory])
    dispatcher(np.arange(len(rows)), rows)
    return dispatcher.signals, {n: c.tolist() for n, c in memory.columns()[1].items()}


@pytest.mark.parametrize(
    ("unit", "of_fmu", "factor", "offset"),
    [
        ("m", "m", 1.0, 0.0),
        ("m", "mm", 1e-3, 0.0),
        ("mm", "m", 1e3, 0.0),
        ("K", "degC", 1.0, 273.15),
        ("degC", "K", 1.0, -273.15),
    ],
)
def test_an_output_is_converted_into_its_unit(tmp_path, unit, of_fmu, factor, offset):
    described = fmu(f"output Real y - {of_fmu}", "output Real z - m")
    drawn = connect("a/z", "Plain") + connect("a/y", "Out")
    top = system("top", component("a"), drawn, f"output Plain; output Out Real {unit}")
    loaded = System.load(archive(tmp_path, structure(top), {"a": described}))
    rows = np.array([[1.0, 7.0, 3.0], [-2.5, 7.0, np.inf]])
    signals, columns = recorded(loaded, {Port("a", "z"): 2, Port("a", "y"): 0}, rows)
    assert columns["Plain"] == [3.0, np.inf]
    assert columns["Out"] == pytest.approx([factor * y + offset for y in (1.0, -2.5)], rel=1e-15)
    assert [signal.unit for signal in signals if signal.name == "Out"] == [unit]


def test_what_a_float64_does_not_hold_is_not_finite_and_no_warning(tmp_path):
    described = fmu("output Real y - m")
    top = system("top", component("a"), connect("a/y", "Out"), "output Out Real mm")
    loaded = System.load(archive(tmp_path, structure(top), {"a": described}))
    _, columns = recorded(loaded, {Port("a", "y"): 0}, np.array([[1e307], [-1.0]]))
    assert columns["Out"] == [np.inf, -1e3]
