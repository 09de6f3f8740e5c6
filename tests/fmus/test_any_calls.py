"""Whatever a host calls, in whatever order and with whatever numbers: it lives.

Drawn are sequences of calls, legal and illegal. After each call the status is one that FMI knows
and never fatal; where a call was refused the log says why; a fresh life of the same instance then
computes what it always does. And the native FMU does in all what the one in Python does.
"""

import pytest
from grasp_fmus.shipped import SHIPPED
from hypothesis import HealthCheck, given
from support.drawn_calls import SEQUENCES, Drawn
from support.fmi2 import OK, Instance, drive
from support.kinds import NAMES, all_kinds
from support.marks import examples, slow
from support.twins import Twins

FIRST, *OTHERS = SHIPPED


def in_order(fmu):
    with Instance(fmu).initialise() as instance:
        assert {instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
        return instance.outputs()


@all_kinds
@pytest.mark.hypothesis  # it finds those that are decorated, not what is inside of them
@pytest.mark.parametrize("name", [FIRST, *map(slow, OTHERS)])
def test_any_sequence_of_calls(load, name):
    expected = in_order(load(name))

    @given(sequence=SEQUENCES)
    @examples(150, suppress_health_check=list(HealthCheck))
    def run(sequence):
        with Instance(load(name), "one") as one, Instance(load(name), "two") as two:
            drawn = (Drawn(one), Drawn(two))
            for which, call in sequence:
                target = drawn[which]
                target.instance.log.clear()
                status = target.call(*call)
                assert status in (OK, one.fmu.discarded, one.fmu.refused)
                assert bool(target.instance.log) == (status != OK)
            for target in drawn:
                for state in target.states:
                    state.free()
                assert target.instance.call("Reset") == OK
                target.instance.initialise()
                assert {target.instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
                assert target.instance.outputs() == expected
                assert target.instance.call("Terminate") == OK

    run()


# An FMU that Python runs and the native one, call by call: values, refusals, bytes of states

twins = pytest.mark.kinds("native", "native FMI 3")


@twins
@pytest.mark.hypothesis
@pytest.mark.parametrize("name", NAMES)
def test_any_sequence_of_calls_in_both(load_as, kind, name):
    @given(sequence=SEQUENCES)
    @examples(100, suppress_health_check=list(HealthCheck))
    def run(sequence):
        with Twins(load_as(name, "python"), load_as(name, kind)) as twins:
            drawn = Drawn(twins)
            for _, call in sequence:
                if call[0] != "setup" or kind != "native FMI 3":  # which has no such call
                    drawn.call(*call)
            for state in drawn.states:
                state.free()
            assert twins.call("Reset") == OK
            assert (twins.setup(), twins.enter(), twins.exit()) == (OK, OK, OK)
            for k in range(5):
                assert twins.step(k * 1e-3, 1e-3) == OK
                twins.outputs()
            assert twins.call("Terminate") == OK

    run()


@twins
@pytest.mark.parametrize("name", NAMES)
def test_a_run_that_is_saved_in_one_goes_on_in_the_other(load_as, kind, name):
    """To and fro; with the bytes alone, in an instance that has had another life."""
    python, native = load_as(name, "python"), load_as(name, kind)
    with Instance(python).initialise() as alone:
        expected = drive(alone, 0, 400)
    seen = []
    saved = b""
    for k, fmu in enumerate((python, native, python, native)):
        with Instance(fmu, "another").initialise() as instance:
            if saved:
                drive(instance, 0, 7)
                status, state = instance.from_bytes(saved)
                assert (status, instance.restore(state)) == (OK, OK)
                state.free()
            seen += drive(instance, 100 * k, 100 * (k + 1))
            state = instance.state()
            saved = state.to_bytes()
            state.free()
    assert seen == expected
