"""Instances of native twins share one library in a process, and nothing else."""

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

from fmi.instances import Bound, variable
from grasp_cosim.fmi.fmi2 import SharedInstance
from grasp_cosim.fmi.instance import OK
from grasp_cosim.fmi.make_instance import load
from grasp_cosim.system.parts import Component
from support.native_fmus import build, needs_gcc

pytestmark = needs_gcc


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
