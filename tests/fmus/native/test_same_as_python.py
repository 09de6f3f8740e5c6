"""A native FMU and that of the same block in Python: the same calls, the same answers, to the byte.

Statuses, values, texts in the log, bytes of states. Where Python logs a traceback, C logs its last
line; where pythonfmu itself refuses, it says nothing.
"""

import re
import struct
from collections import Counter
from ctypes import c_double, c_int, c_size_t, c_uint
from hashlib import blake2b
from math import inf, nan
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.campaign import seeds
from support.examples import examples
from support.fmi2 import DISCARD, ERROR, OK, Fmu, Instance, Logged, State
from support.hand_written import content, native_fmu, python_fmu
from support.kinds import TRANSLATED
from support.native_fmus import needs_gcc
from support.packages import needs_pythonfmu

pytestmark = [needs_gcc, needs_pythonfmu]

FAULT, SEED, NOISY, HELD = 9, 8, 10, 1
REALS = {"force": 0, "position": 2, "velocity": 3, "mass": 5, "gain": 6, "start": 7}

Act = tuple[Any, ...]
"""A call by its name, and its arguments."""


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> tuple[Fmu, Fmu]:
    folder = tmp_path_factory.mktemp("twins")
    python = python_fmu(folder / "python")
    native = native_fmu(folder / "native", content=content(python))
    return Fmu(python, folder / "one"), Fmu(native, folder / "two")


class Twin:
    """An instance, and the state that it saved last."""

    def __init__(self, fmu: Fmu, name: str = "twin") -> None:
        self.instance = Instance(fmu, name)
        self.saved: State | None = None
        self.time = self.saved_at = 0.0

    def end(self) -> None:
        if self.saved:
            self.saved.free()
        self.instance.call("FreeInstance")

    def answer(self, act: Act) -> tuple[Any, list[Logged]]:
        """What a call gives, and what it logs."""
        self.instance.log.clear()
        found = getattr(self, f"_{act[0]}")(*act[1:])
        return found, [said._replace(text=comparable(said.text)) for said in self.instance.log]

    def _call(self, name: str, *arguments: Any) -> int:
        return self.instance.call(name, *arguments)

    def _setup(self, start: float) -> int:
        return self.instance.setup(start)

    def _set(self, kind: str, values: list[tuple[int, float]]) -> int:
        n = len(values)
        item: Any = c_double if kind == "Real" else c_int
        numbers = (item * n)(*(v for _, v in values))
        references = (c_uint * n)(*(r for r, _ in values))
        return self.instance.call(f"Set{kind}", references, c_size_t(n), numbers)

    def _get(self, kind: str, references: list[int]) -> tuple[int, bytes]:
        n = len(references)
        values = ((c_double if kind == "Real" else c_int) * n)()
        status = self.instance.call(f"Get{kind}", (c_uint * n)(*references), c_size_t(n), values)
        return status, b"" if status else bytes(values)

    def _step(self, h: float, off: float) -> int:
        status = self.instance.step(self.time + off, h)
        if status == OK:
            self.time += off + h
        return status

    def _save(self) -> bytes:
        if self.saved:
            self.saved.free()
        self.saved, self.saved_at = self.instance.state(), self.time
        return self.saved.to_bytes()

    def _restore(self) -> int | None:
        if not self.saved:
            return None
        self.time = self.saved_at
        return self.instance.restore(self.saved)

    def _read(self, data: bytes) -> tuple[int, bytes]:
        status, state = self.instance.from_bytes(data)
        if status == OK:
            data = state.to_bytes()
            state.free()
        return status, data


PYTHONS_OWN = re.compile(
    r"(?<=ZeroDivisionError: )[^:]+|(?<=ValueError: )(math dom|expected a )[^:]+"
)
"""What an operator or a function of Python's says, another text in each version."""


def comparable(text: str) -> str:
    """The last line of a traceback, in the words of the block; a ValueError of sqrt in none."""
    begin, found, rest = text.partition("Traceback (most recent call last):")
    return PYTHONS_OWN.sub("...", begin + rest.splitlines()[-1] if found else text)


def the_same(twins: tuple[Fmu, Fmu], acts: list[Act], name: str = "twin") -> list[Any]:
    """The answers of both, which are the same."""
    python, native = (Twin(fmu, name) for fmu in twins)
    try:
        answers = []
        for act in acts:
            answers.append(native.answer(act))
            assert answers[-1] == python.answer(act), act
        return answers
    finally:
        python.end()
        native.end()


READY: list[Act] = [
    ("setup", 0.0),
    ("call", "EnterInitializationMode"),
    ("call", "ExitInitializationMode"),
]


class Drawn:
    """Calls drawn at random for an FMU, often in the ranges of its variables."""

    def __init__(self, fmu: Fmu, random: Random) -> None:
        self._random = random
        root = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()
        self._ranges: dict[int, tuple[float, float]] = {}
        for v in root.iter("ScalarVariable"):
            low, high = (float(v[0].get(key, nan)) for key in ("min", "max"))
            self._ranges[int(v.get("valueReference", ""))] = low, high
        kinds = {fmu.references[name]: kind for name, kind in fmu.kinds.items()}
        self._by_kind = {k: [r for r in kinds if kinds[r] == k] for k in set(kinds.values())}
        self._inputs = [r for r in map(fmu.references.get, fmu.names("input")) if r is not None]
        self._inputs = [r for r in self._inputs if kinds[r] == "Real"]
        self._outputs = [fmu.references[n] for n in fmu.names("output")]
        self._outputs = [r for r in self._outputs if kinds[r] == "Real"]

    def _number(self, low: float, high: float) -> float:
        r = self._random
        if low < high and r.random() < 0.6:
            return float(r.choice([low, high, r.uniform(low, high), low + (high - low) * 1e-3]))
        if r.random() < 0.2:
            return float(r.choice([0.0, -0.0, 5e-324, 1e300, -1e300, inf, nan]))
        return float(r.choice([1.0, -1.0]) * 10.0 ** r.uniform(-9.0, 3.0))

    def parameters(self) -> Act:
        kind = self._random.choice(["Real", "Real", "Boolean", "Integer"])
        chosen = self._random.choices(self._by_kind.get(kind, [0]), k=2)
        if kind == "Real":
            return "set", kind, [(r, self._number(*self._ranges[r])) for r in chosen]
        return "set", kind, [(r, self._random.choice([0, 1, 2, 5, -1])) for r in chosen]

    def act(self) -> Act:
        r = self._random
        choice = r.randrange(10)
        if choice < 3:
            return "step", r.choice([1e-4, 1e-3, 1e-2, 0.3, float(10.0 ** r.uniform(-6, 8))]), 0.0
        if choice < 6:
            return "set", "Real", [(u, self._number(-1.0, 1.0)) for u in self._inputs]
        if choice == 6:
            return self.parameters()
        if choice == 7:
            return "get", "Real", self._outputs
        return ("save",) if choice == 8 else ("restore",)


@pytest.mark.parametrize("name", TRANSLATED)
@pytest.mark.parametrize(
    "seeds",
    [range(20), pytest.param(seeds(600), marks=[pytest.mark.slow, pytest.mark.campaign])],
    ids=["few", "many"],
)
def test_any_calls_of_the_blocks_that_come_with_the_package(
    name: str, seeds: range, fmus: Path, natives: Path, tmp_path: Path
) -> None:
    python, native = fmus / f"{name}.fmu", natives / f"{name}.fmu"
    both = Fmu(python, tmp_path / "one"), Fmu(native, tmp_path / "two")
    steps = Counter[int]()
    for seed in seeds:
        drawn = Drawn(both[0], Random(f"{name} {seed}"))
        acts = [drawn.parameters() for _ in range(seed % 6)] + READY
        acts += [drawn.act() for _ in range(60)]
        answers = the_same(both, acts)
        steps.update(a[0] for a, act in zip(answers, acts, strict=True) if act[0] == "step")
    assert steps[OK] > len(seeds)
    assert steps[DISCARD] or "Controller" in name


numbers = st.one_of(
    st.floats(),
    st.sampled_from([0.0, -0.0, 1.0, 0.5, 1e-3, 1e3, 1e300, -1e300, 5e-324, inf, -inf, nan]),
)
references = st.one_of(st.integers(0, 10), st.sampled_from([11, 99, 2**31, 2**32 - 1]))
whole = st.one_of(st.integers(-3, 8), st.sampled_from([-(2**31), 2**31 - 1]))
kinds = st.sampled_from(["Real", "Integer", "Boolean"])
calls = st.one_of(
    st.tuples(st.just("setup"), numbers),
    st.tuples(
        st.just("call"),
        st.sampled_from(
            ["EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"]
        ),
    ),
    st.tuples(
        st.just("set"),
        st.just("Real"),
        st.lists(st.tuples(st.sampled_from([*REALS.values(), 1, 99]), numbers), max_size=3),
    ),
    st.tuples(st.just("set"), st.just("Real"), st.lists(st.tuples(st.just(0), numbers))),
    st.tuples(st.just("set"), kinds.filter("Real".__ne__), st.lists(st.tuples(references, whole))),
    st.tuples(
        st.just("set"), st.just("Integer"), st.tuples(st.just(FAULT), whole).map(lambda v: [v])
    ),
    st.tuples(st.just("get"), kinds, st.lists(references, max_size=3)),
    st.tuples(st.just("get"), st.just("Real"), st.just([2, 3])),
    st.tuples(st.just("get"), st.just("Boolean"), st.just([4])),
    st.tuples(
        st.just("step"),
        st.one_of(st.sampled_from([1e-4, 1e-3, 0.5, 1.5, 1e300]), numbers),
        st.one_of(st.sampled_from([0.0, 0.0, 0.0, 1e-9, 1e-8]), numbers),
    ),
    st.just(("save",)),
    st.just(("restore",)),
)


@given(st.booleans(), st.lists(calls, max_size=20))
@examples(200)
def test_any_calls(twins: tuple[Fmu, Fmu], ready: bool, acts: list[Act]) -> None:
    the_same(twins, [*READY, *acts] if ready else acts)


@pytest.mark.parametrize("fault", range(7))
def test_each_fault_in_a_step_and_in_a_getter(twins: tuple[Fmu, Fmu], fault: int) -> None:
    acts: list[Act] = [("set", "Integer", [(FAULT, fault)]), ("step", 1e-3, 0.0)]
    acts += [("get", "Real", [2, 3]), ("set", "Integer", [(FAULT, 0)]), ("step", 1e-3, 0.0)]
    answers = the_same(twins, [*READY, *acts, ("save",)])[len(READY) :]
    expected = {0: OK, 1: DISCARD, 2: DISCARD, 3: ERROR, 4: ERROR, 5: OK, 6: DISCARD}
    assert answers[1][0] == expected[fault]


@pytest.mark.parametrize("fault", range(7))
def test_each_fault_in_initialisation(twins: tuple[Fmu, Fmu], fault: int) -> None:
    acts: list[Act] = [("set", "Integer", [(FAULT, fault)]), READY[1], ("get", "Real", [2])]
    acts += [("set", "Integer", [(FAULT, 0)]), READY[1], READY[2], ("step", 1e-3, 0.0), ("save",)]
    the_same(twins, acts)


def test_parameters_that_do_not_go_together(twins: tuple[Fmu, Fmu]) -> None:
    acts: list[Act] = [("set", "Integer", [(SEED, 0)]), ("set", "Boolean", [(NOISY, 5)]), READY[1]]
    acts += [("get", "Boolean", [NOISY]), ("save",), ("set", "Boolean", [(NOISY, 0)]), *READY]
    answers = the_same(twins, acts)
    assert answers[2][1][0].text == "twin, t = 0 s: seed = 0: must be above 0 with noise, 100 %%"


@given(
    st.one_of(st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=40)),
    numbers,
)
@example("50 %s", 1e300)
@examples(50)
def test_any_name_and_time(twins: tuple[Fmu, Fmu], name: str, start: float) -> None:
    acts: list[Act] = [("setup", start), *READY[1:], ("set", "Real", [(0, nan)])]
    the_same(twins, [*acts, ("step", nan, 0.0), ("step", 1e-3, 1.0)], name)


@pytest.mark.parametrize(("start", "off"), [(0.0, 1e-9), (-3.0, 1e-9), (1e6, 1e-6), (1e300, 1e288)])
@pytest.mark.parametrize("factor", [1.5, 0.8, -0.8, -1.5])
def test_how_far_the_clocks_may_be_apart(
    twins: tuple[Fmu, Fmu], start: float, off: float, factor: float
) -> None:
    acts: list[Act] = [("setup", start), *READY[1:], ("step", 1e-3, start + factor * off)]
    (status, _) = the_same(twins, acts)[-1]
    assert status == (OK if abs(factor) < 1.0 else ERROR)


@pytest.mark.parametrize("reference", range(5, 11))
@pytest.mark.parametrize("ready", [1, 2])
def test_each_parameter_that_is_set_late(
    twins: tuple[Fmu, Fmu], reference: int, ready: int
) -> None:
    """After outputs were read, which may not keep what they came from."""
    kind = {SEED: "Integer", FAULT: "Integer", NOISY: "Boolean"}.get(reference, "Real")
    acts: list[Act] = [("set", "Real", [(0, 3.0)]), *READY[:ready], ("get", "Real", [2, 3])]
    acts += [("set", kind, [(reference, 2)]), ("get", "Real", [2, 3]), *READY[ready:]]
    the_same(twins, [*acts, ("step", 1e-3, 0.0), ("get", "Real", [2, 3]), ("save",)])


WHOLE = (-0.5, -0.0, 2.7, -7.9, 1e300, -1e300, inf, nan, 0.5)


@pytest.mark.parametrize("number", WHOLE)
@pytest.mark.parametrize("place", [0, 1, 3, 7, 12, 13])
def test_a_state_with_a_number_that_is_not_whole(
    twins: tuple[Fmu, Fmu], place: int, number: float
) -> None:
    """The phase, the time, a Boolean, an Integer, and both of the block's state."""
    ((good, _),) = the_same(twins, [*READY, ("step", 1e-3, 0.0), ("save",)])[-1:]
    the_same(twins, [("read", altered(good, [(place, number)]))])


def altered(state: bytes, changes: list[tuple[int, float]], signed: bool = True) -> bytes:
    """A state with other numbers at places, with the right check sum if it is signed."""
    data = bytearray(state)
    for place, number in changes:
        data[40 + 8 * place : 48 + 8 * place] = struct.pack("<d", number)
    if signed:
        data[24:40] = blake2b(bytes(data[8:24] + data[40:]), digest_size=16).digest()
    return bytes(data)


@given(st.lists(st.tuples(st.integers(0, 13), numbers), max_size=3), st.booleans(), st.data())
@examples(200)
def test_any_state(
    twins: tuple[Fmu, Fmu], changes: list[tuple[int, float]], signed: bool, data: st.DataObject
) -> None:
    """Bytes with any numbers in them, with the right check sum or not, and some cut off."""
    ((good, _),) = the_same(twins, [*READY, ("step", 1e-3, 0.0), ("save",)])[-1:]
    state = bytearray(altered(good, changes, signed))
    if not signed:
        at = data.draw(st.integers(0, len(state)))
        state[at : at + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
    the_same(twins, [("read", bytes(state))])


def test_a_run_goes_on_in_the_other(twins: tuple[Fmu, Fmu]) -> None:
    for one, other in (twins, twins[::-1]):
        first, second = Twin(one), Twin(other)
        for act in [*READY, ("set", "Real", [(0, 3.0)]), *[("step", 1e-3, 0.0)] * 20]:
            first.answer(act)
        data = first.instance.state().to_bytes()
        status, state = second.instance.from_bytes(data)
        assert (status, second.instance.restore(state)) == (OK, OK)
        second.time = first.time
        for act in [("step", 1e-3, 0.0), ("get", "Real", [2, 3]), ("save",)]:
            assert first.answer(act) == second.answer(act)
        first.end()
        second.end()
