"""Two instances of one block, in Python and native, called as one: what they do must agree.

Both take a call or both refuse it, for the same reason: of the same variable, with the same limits.
"""

from ctypes import Array, c_char_p
from typing import TypeVar

from hypothesis import reject

from .fmi2 import OK, Instance, State

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
