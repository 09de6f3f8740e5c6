"""Whatever a host calls, in whatever order and with whatever numbers: it lives.

Drawn are sequences of calls, legal and illegal. After each call the status is one that FMI knows
and never fatal; where a call was refused the log says why; a fresh life of the same instance then
computes what it always does. And the native FMU does in all what the one in Python does.
"""

from ctypes import Array, c_char_p, c_double, c_int, c_size_t, c_uint

import pytest
from grasp_cosim.fmu_export.shipped import SHIPPED
from hypothesis import HealthCheck, given, reject
from hypothesis import strategies as st
from support.fmi2 import OK, Instance, State, drive
from support.kinds import NAMES, all_kinds
from support.marks import examples, slow

SENSIBLE = st.sampled_from([0.0, 1e-3, 0.01, 0.05, 0.1, 0.5, 1.0, -0.1, -1.0])
NUMBERS = st.one_of(SENSIBLE, st.floats(width=64))
REFERENCES = st.lists(st.one_of(st.integers(0, 30), st.integers(0, 2**32 - 1)), max_size=6)
TYPES = {"Real": c_double, "Boolean": c_int, "Integer": c_int, "String": c_char_p}
CALLS = st.one_of(
    st.tuples(st.just("setup"), NUMBERS),
    st.tuples(st.sampled_from(["enter", "exit", "terminate", "reset"])),
    st.tuples(st.sampled_from(["step", "step", "step"]), NUMBERS, NUMBERS),
    st.tuples(st.just("next"), st.sampled_from([1e-4, 1e-3, 0.1])),
    st.tuples(st.just("set"), REFERENCES, st.lists(NUMBERS, min_size=6, max_size=6)),
    st.tuples(st.just("input"), NUMBERS),
    st.tuples(st.just("assign"), st.integers(0, 60), NUMBERS),
    st.tuples(st.just("read"), REFERENCES, st.sampled_from([*TYPES])),
    st.tuples(st.just("set_boolean"), REFERENCES),
    st.tuples(st.sampled_from(["save", "restore", "bytes"])),
    st.tuples(st.just("damage"), st.binary(max_size=300)),
)
SEQUENCES = st.lists(st.tuples(st.integers(0, 1), CALLS), max_size=40)


class Drawn:
    """An instance, or two that are called as one, called as drawn."""

    def __init__(self, instance):
        self.instance, self.time, self.states = instance, 0.0, []

    def call(self, action, *drawn):
        """One drawn call; returns its status."""
        own = getattr(self, f"_{action}", None)
        return own(*drawn) if own else getattr(self.instance, action)(*drawn)

    def live(self):
        """A fresh life, in which all is as ever; the outputs in the end."""
        for state in self.states:
            state.free()
        assert self.instance.call("Reset") == OK
        return in_order(self.instance)

    def _setup(self, start):
        status = self.instance.setup(start)
        self.time = start if status == OK else self.time
        return status

    def _terminate(self):
        return self.instance.call("Terminate")

    def _reset(self):
        self.time = 0.0
        return self.instance.call("Reset")

    def _next(self, size):
        status = self.instance.step(self.time, size)
        self.time += size if status == OK else 0.0
        return status

    def _set(self, references, values):
        known = self._known(references)
        return self.instance.set_real(known, values[: len(known)])

    def _input(self, value):
        return self.instance.set({self.instance.fmu.names("input")[0]: value})

    def _known(self, references):
        """Without that of the time, which is a variable in FMI 3.0 alone."""
        return [vr for vr in references if vr != len(self.instance.fmu.references)]

    def _assign(self, which, value):
        """Any variable, in its own type."""
        names = list(self.instance.fmu.references)
        name = names[which % len(names)]
        if self.instance.fmu.kinds[name] != "Real":
            value = min(max(value, -2e9), 2e9) if value == value else 0.0
        return self.instance.assign({name: value})

    def _set_boolean(self, references):
        known = self._known(references)
        return self.instance.set_boolean(known, [True] * len(known))

    def _read(self, references, kind):
        known = self._known(references)
        n = len(known)
        vector, values = (c_uint * n)(*known), (TYPES[kind] * n)()
        return self.instance.call(f"Get{kind}", vector, c_size_t(n), values)

    def _save(self):
        self.states.append(self.instance.state())
        return OK

    def _restore(self):
        return self.instance.restore(self.states[-1]) if self.states else OK

    def _bytes(self):
        if not self.states:
            return OK
        status, state = self.instance.from_bytes(self.states[-1].to_bytes())
        self.states.append(state)
        return status

    def _damage(self, data):
        status = self.instance.from_bytes(data)[0]
        assert status == self.instance.fmu.refused
        return status


FIRST, *OTHERS = SHIPPED


def in_order(instance):
    """The outputs after five steps."""
    assert (instance.setup(), instance.enter(), instance.exit()) == (OK, OK, OK)
    assert {instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
    return instance.outputs()


@all_kinds
@pytest.mark.hypothesis  # it finds those that are decorated, not what is inside of them
@pytest.mark.parametrize("name", [FIRST, *map(slow, OTHERS)])
def test_any_sequence_of_calls(load, name):
    with Instance(load(name)) as instance:
        expected = in_order(instance)

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
                assert target.live() == expected
                assert target.instance.call("Terminate") == OK

    run()


# An FMU that Python runs and the native one, call by call: values, refusals, bytes of states


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
            drawn.live()
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
