"""When the clocks of an FMU tick, by what it says of their intervals; times are exact."""

from fractions import Fraction
from math import inf, nan
from types import SimpleNamespace

import pytest
from grasp_cosim import SimulationError
from grasp_cosim.fmi.clocks import CHANGED, NOT_YET_KNOWN, UNCHANGED, Clocks
from grasp_cosim.interface.variables import Clock

TENTH = Fraction(1, 10)


class FakeFmu:
    """The functions of an FMU for clocks: what it says, by reference, and what it is told."""

    def __init__(self, **clocks):
        self.interface = SimpleNamespace(
            input_clocks=[
                SimpleNamespace(name=name, reference=reference, clock=clock)
                for reference, (name, clock) in enumerate(clocks.items(), 5)
            ]
        )
        self.intervals, self.shifts, self.ticked, self.status = {}, {}, [], 0
        self.clocks = Clocks(self.interface, self.bind, self.refuse)

    def bind(self, name, *types):
        return getattr(self, name)

    def refuse(self, reason, status):
        return SimulationError(f"it {reason} ({status})")

    def SetClock(self, references, count, active):
        assert [*active] == [True] * count == [True] * len(references)
        self.ticked.append([*references])
        return self.status

    def GetIntervalDecimal(self, reference, count, interval, qualifier):
        said = self.intervals[reference._obj.value]
        interval._obj.value, qualifier._obj.value = said
        return self.status

    def GetIntervalFraction(self, reference, count, counter, resolution, qualifier):
        (counter._obj.value, resolution._obj.value), qualifier._obj.value = self.intervals[
            reference._obj.value
        ]
        return self.status

    def GetShiftDecimal(self, reference, count, shift):
        shift._obj.value = self.shifts[reference._obj.value]
        return self.status

    def GetShiftFraction(self, reference, count, counter, resolution):
        counter._obj.value, resolution._obj.value = self.shifts[reference._obj.value]
        return self.status

    def event(self, time):
        """An event at that time; the references of the clocks that tick."""
        self.clocks.begin(time)
        ticked = self.clocks.tick()
        self.clocks.schedule(ticked)
        return sorted(ticked)


def test_a_constant_clock_ticks_at_whole_intervals_from_its_shift_on():
    fmu = FakeFmu(a=Clock("constant", TENTH, Fraction(1, 4)), b=Clock("fixed", Fraction(1, 3)))
    fmu.clocks.initialise(0.5)
    assert fmu.clocks.next == 0.5
    assert fmu.event(0.5) == [6]
    assert fmu.clocks.next == 0.75
    assert fmu.event(0.6) == []
    assert fmu.event(0.75) == [5]
    for _ in range(100):
        time = fmu.clocks.next
        assert fmu.event(time)
    a = (Fraction(fmu.clocks.saved()[1][5]) - Fraction(3, 4)) / TENTH
    b = (Fraction(fmu.clocks.saved()[1][6]) - Fraction(1, 2)) * 3
    assert a.denominator == b.denominator == 1
    assert fmu.ticked[0] == [6]


@pytest.mark.parametrize("before", [0.0, 1e-13])
def test_two_that_are_due_together_tick_in_one_event(before):
    fmu = FakeFmu(a=Clock("constant", TENTH), b=Clock("constant", Fraction(1, 5)))
    fmu.clocks.initialise(0.0)
    assert fmu.event(0.0) == [5, 6]
    assert fmu.event(0.1) == [5]
    assert fmu.event(0.2 - before) == [5, 6]
    assert [*map(sorted, fmu.ticked)] == [[5, 6], [5], [5, 6]]
    assert fmu.clocks.next == 0.3


@pytest.mark.parametrize("fractions", [False, True])
def test_a_calculated_clock_is_as_the_fmu_says_at_the_start(fractions):
    fmu = FakeFmu(a=Clock("calculated", fractions=fractions))
    fmu.intervals[5] = ((1, 10) if fractions else 0.1), CHANGED
    fmu.shifts[5] = (1, 4) if fractions else 0.25
    fmu.clocks.initialise(1.0)
    assert fmu.clocks.saved() == ({5: TENTH}, {}, {5: Fraction(5, 4)})
    assert fmu.event(1.25) == [5]
    assert fmu.clocks.next == 1.35


def test_a_tuned_interval_counts_from_the_last_tick_and_never_from_before_now():
    fmu = FakeFmu(a=Clock("tunable", TENTH))
    fmu.shifts[5] = 0.0
    fmu.intervals[5] = 0.1, UNCHANGED
    fmu.clocks.initialise(0.0)
    assert fmu.event(0.0) == [5]
    fmu.intervals[5] = 0.5, CHANGED
    assert fmu.event(0.05) == []
    assert fmu.clocks.next == 0.5
    fmu.intervals[5] = 0.0, CHANGED  # none
    assert (fmu.event(0.06), fmu.clocks.next) == ([], 0.5)
    fmu.intervals[5] = 0.2, NOT_YET_KNOWN
    assert (fmu.event(0.07), fmu.clocks.next) == ([], 0.5)
    fmu.intervals[5] = 0.01, CHANGED
    assert (fmu.event(0.3), fmu.clocks.next) == ([], 0.3)
    assert fmu.event(0.3) == [5]
    assert fmu.clocks.next == 0.31


def test_a_tunable_clock_without_an_interval_asks_for_it():
    fmu = FakeFmu(a=Clock("tunable"))
    fmu.shifts[5], fmu.intervals[5] = 0.5, (0.25, CHANGED)
    fmu.clocks.initialise(0.0)
    assert fmu.clocks.next == 0.5
    assert (fmu.event(0.5), fmu.clocks.next) == ([5], 0.75)


def test_a_countdown_begins_where_the_fmu_says_that_it_changed():
    fmu = FakeFmu(a=Clock("countdown"))
    fmu.intervals[5] = 0.0, NOT_YET_KNOWN
    fmu.clocks.initialise(0.0)
    assert fmu.clocks.next == inf
    fmu.intervals[5] = 0.2, CHANGED
    assert (fmu.event(0.5), fmu.clocks.next) == ([], 0.7)
    fmu.intervals[5] = 0.9, UNCHANGED
    assert (fmu.event(0.6), fmu.clocks.next) == ([], 0.7)
    assert (fmu.event(0.7), fmu.clocks.next) == ([5], inf)
    fmu.intervals[5] = 0.0, CHANGED  # at once
    assert fmu.event(0.8) == [5]


def test_a_changing_interval_is_asked_for_at_each_tick():
    fmu = FakeFmu(a=Clock("changing"))
    fmu.intervals[5] = 0.1, CHANGED
    fmu.clocks.initialise(0.0)
    assert fmu.clocks.next == 0.1
    fmu.intervals[5] = 0.3, CHANGED
    assert (fmu.event(0.1), fmu.clocks.next) == ([5], 0.4)
    saved = fmu.clocks.saved()
    fmu.intervals[5] = 0.5, CHANGED
    assert (fmu.event(0.4), fmu.clocks.next) == ([5], 0.9)
    fmu.clocks.restore(saved)
    assert fmu.clocks.next == 0.4


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ((nan, CHANGED), "says nan s for its clock 'a' (0)"),
        ((inf, CHANGED), "says inf s for its clock 'a' (0)"),
        ((-0.1, CHANGED), "says -0.1 s for its clock 'a' (0)"),
        ((0.0, CHANGED), "does not say the interval of its clock 'a' (changing) (0)"),
        ((0.1, NOT_YET_KNOWN), "does not say the interval of its clock 'a' (changing) (0)"),
    ],
)
def test_an_interval_that_is_none_is_refused(said, reason):
    fmu = FakeFmu(a=Clock("changing"))
    fmu.intervals[5] = said
    with pytest.raises(SimulationError) as caught:
        fmu.clocks.initialise(0.0)
    assert str(caught.value) == f"it {reason}"


def test_a_fraction_without_a_denominator_is_refused():
    fmu = FakeFmu(a=Clock("changing", fractions=True))
    fmu.intervals[5] = (3, 0), CHANGED
    with pytest.raises(SimulationError, match="it says 3/0 s for its clock 'a'"):
        fmu.clocks.initialise(0.0)


@pytest.mark.parametrize(("status", "goes_on"), [(0, True), (1, True), (2, False), (3, False)])
def test_a_call_may_return_a_warning_and_no_error(status, goes_on):
    fmu = FakeFmu(a=Clock("constant", TENTH), b=Clock("countdown"))
    fmu.intervals[6] = 0.0, NOT_YET_KNOWN
    fmu.clocks.initialise(0.0)
    fmu.status = status
    if goes_on:
        assert fmu.event(0.0) == [5]
    else:
        said = rf"^it does not say the interval of its clock 'b' \({status}\)$"
        with pytest.raises(SimulationError, match=said):
            fmu.event(0.0)
        fmu.interface.input_clocks.pop()
        with pytest.raises(SimulationError, match=r"^it does not let its clocks tick"):
            fmu.event(0.0)


def test_an_fmu_without_clocks_is_asked_nothing():
    fmu = FakeFmu()
    fmu.clocks.initialise(0.0)
    assert (fmu.event(0.0), fmu.clocks.next, fmu.ticked) == ([], inf, [])
