"""Sequences of calls, legal and illegal, for hypothesis to draw."""

import ctypes
from dataclasses import dataclass, field

from hypothesis import strategies as st

from .fmi2 import OK, Instance, State

ANY = st.floats(width=64)
SENSIBLE = st.sampled_from([0.0, 1e-3, 0.01, 0.05, 0.1, 0.5, 1.0, -0.1, -1.0])
NUMBERS = st.one_of(SENSIBLE, ANY)
REFERENCES = st.lists(st.one_of(st.integers(0, 30), st.integers(0, 2**32 - 1)), max_size=6)
CALLS = st.one_of(
    st.tuples(st.just("setup"), NUMBERS),
    st.tuples(st.sampled_from(["enter", "exit", "terminate", "reset"])),
    st.tuples(st.sampled_from(["step", "step", "step"]), NUMBERS, NUMBERS),
    st.tuples(st.just("next"), st.sampled_from([1e-4, 1e-3, 0.1])),
    st.tuples(st.just("set"), REFERENCES, st.lists(NUMBERS, min_size=6, max_size=6)),
    st.tuples(st.just("input"), NUMBERS),
    st.tuples(st.just("assign"), st.integers(0, 60), NUMBERS),
    st.tuples(st.sampled_from(["get", "get_boolean", "get_integer", "get_string"]), REFERENCES),
    st.tuples(st.just("set_boolean"), REFERENCES),
    st.tuples(st.sampled_from(["save", "restore", "bytes"])),
    st.tuples(st.just("damage"), st.binary(max_size=300)),
)
SEQUENCES = st.lists(st.tuples(st.integers(0, 1), CALLS), max_size=40)


@dataclass
class Drawn:
    """An instance, or two that are called as one, called as drawn."""

    instance: Instance
    time: float = 0.0
    states: list[State] = field(default_factory=list)

    def call(self, action, *drawn):
        """One drawn call; returns its status."""
        return getattr(self, f"_{action}")(*drawn)

    def _setup(self, start):
        status = self.instance.setup(start)
        self.time = start if status == OK else self.time
        return status

    def _enter(self):
        return self.instance.enter()

    def _exit(self):
        return self.instance.exit()

    def _terminate(self):
        return self.instance.call("Terminate")

    def _reset(self):
        self.time = 0.0
        return self.instance.call("Reset")

    def _step(self, time, size):
        return self.instance.step(time, size)

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

    def _get(self, references):
        return self.instance.get_real(self._known(references))[0]

    def _get_boolean(self, references):
        return self.instance.get_boolean(self._known(references))[0]

    def _set_boolean(self, references):
        known = self._known(references)
        return self.instance.set_boolean(known, [True] * len(known))

    def _get_integer(self, references):
        return self._array("GetInteger", ctypes.c_int, references)

    def _get_string(self, references):
        return self._array("GetString", ctypes.c_char_p, references)

    def _array(self, function, kind, references):
        references = self._known(references)
        n = len(references)
        vector = (ctypes.c_uint * n)(*references)
        return self.instance.call(function, vector, ctypes.c_size_t(n), (kind * n)())

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

    def _logging(self, on):
        return self.instance.call("SetDebugLogging", on, ctypes.c_size_t(0), None)
