"""The faults of pythonfmu are there that slave.py works around: else that may go."""

import sys
from collections import defaultdict

import pytest
from support.fmi2 import FATAL, Instance
from support.kinds import python_only

pytestmark = python_only

TIMES = 4
"""How often pythonfmu is given the chance to give up a reference."""


@pytest.fixture
def counts(load, monkeypatch):
    """The reference counts of the objects that slave.keep() is called with, before each call."""
    fmu = load("ProximitySensor")
    with Instance(fmu):  # imports the modules of the FMU
        pass
    module = (fmu.folder / "resources/slavemodule.txt").read_text().strip()
    slave = sys.modules[f"fmu_export_{module.rpartition('_')[2]}.slave"]
    counted, keep = defaultdict(list), slave.keep

    def keep_and_count(used):
        counted[type(used).__name__].append(sys.getrefcount(used))
        keep(used)

    monkeypatch.setattr(slave, "keep", keep_and_count)
    return fmu, counted


def test_an_instantiation_gives_up_a_reference_to_the_names_of_the_script(counts):
    """A count that grows says that upstream is mended: see offer() in slave.py."""
    fmu, counted = counts
    for _ in range(TIMES):
        with Instance(fmu):
            pass
    assert len(counted["dict"]) == TIMES
    assert len({*counted["dict"]}) == 1


def test_a_refused_call_gives_up_references_to_class_instance_and_messages(counts):
    """A count that grows says that upstream is mended: see Slave._report() in slave.py."""
    fmu, counted = counts
    with Instance(fmu) as instance:
        for _ in range(TIMES):
            assert instance.exit() == FATAL
        for name in ("Maker", "Slave", "list"):
            assert len(counted[name]) == TIMES
            assert len({*counted[name]}) == 1
