"""Whatever a host calls, in whatever order and with whatever numbers, it lives.

Drawn are sequences of calls, legal and illegal, on two instances. After each call the status is one
that FMI knows and never fatal; where a call was refused the log says why; and after the sequence a
fresh life of the same instance computes what it always does.
"""

import pytest
from grasp_fmus.shipped import SHIPPED
from hypothesis import HealthCheck, given
from support.drawn_calls import SEQUENCES, Drawn
from support.fmi2 import OK, Instance
from support.kinds import all_kinds
from support.marks import examples, slow

pytestmark = all_kinds

FIRST, *OTHERS = SHIPPED


def in_order(fmu):
    with Instance(fmu).initialise() as instance:
        assert {instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
        return instance.outputs()


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
