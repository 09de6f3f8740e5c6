"""Whatever a host calls, in whatever order and with whatever numbers: it lives.

Drawn are sequences of calls, legal and illegal. After each call the status is one that FMI knows
and never fatal; where a call was refused the log says why; a fresh life of the same instance then
computes what it always does. And the native FMU does in all what the one in Python does.
"""

from ctypes import Array, c_char_p
from typing import TypeVar

import pytest
from grasp_fmus.shipped import SHIPPED
from hypothesis import HealthCheck, given, reject
from support.drawn_calls import SEQUENCES, Drawn
from support.fmi2 import OK, Instance, State, drive
from support.kinds import NAMES, all_kinds
from support.marks import examples, slow

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


R = TypeVar("R")


class Twins(Instance):
    """An instance in Python and its native twin; AssertionError where they do not do the same."""

    def __init__(self, python, native):
        self.fmu = python
        self.both = Instance(python, "twins"), Instance(native, "twins")

    def __exit__(self, *_):
        for instance in self.both:
            instance.__exit__()

    def call(self, function, *arguments):
        """Also what they leave in arrays is the same, to the bit."""
        arrays = [a for a in arguments if isinstance(a, Array)]

        def called(instance):
            status = instance.call(function, *arguments)
            return status, [_exact(array) for array in arrays]

        return self._agreed(called, alone=all(len(a) == 1 for a in arrays))[0]

    def state(self):
        return TwinState(*(instance.state() for instance in self.both))

    def restore(self, state):
        """Each goes on from its own."""
        assert isinstance(state, TwinState)
        states = dict(zip(self.both, state.both, strict=True))
        return self._agreed(lambda i: (i.restore(states[i]), []))[0]

    def from_bytes(self, data):
        states = []

        def made(instance):
            status, state = instance.from_bytes(data)
            states.append(state)
            return status, []

        return self._agreed(made)[0], TwinState(*states)

    def _agreed(self, call, alone=True):
        """What both return; the status is that of Python. Of several wrong ones they name one."""
        for instance in self.both:
            instance.log.clear()
        (status, found), (native, same) = map(call, self.both)
        said, reason = (" ".join(i.log[-1].text.split()) if i.log else "" for i in self.both)
        if status != OK and ": must be" not in said and "state of" not in said:
            reject()  # an operation raised in Python: C has IEEE's value and may go on
        assert (status == OK) == (native == OK), (said, reason)
        assert found == same or status != OK
        assert len(self.both[1].log) == (native != OK)
        assert not alone or _named(said) == _named(reason), (said, reason)
        return status, found


class TwinState(State):
    """A state of each, of the same bytes."""

    def __init__(self, one, other):
        self.both = one, other

    def to_bytes(self):
        one, other = (state.to_bytes() for state in self.both)
        assert one == other
        return one

    def free(self):
        for state in self.both:
            state.free()


def _exact(array):
    """Numbers by their bytes, texts by what they are."""
    return list(array) if array._type_ is c_char_p else bytes(array)


def _named(said):
    """The first word of a reason, which is mostly a variable, and where its range begins."""
    reason = said.partition(" s: ")[2]
    return reason.partition(" ")[0], reason.partition("must be from ")[2].partition(" ")[0]


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
