"""One of two runs: which rows of it count, its curves, and a log in the other's types and units."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.comparison.bands import Bands, Given
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.judge import Judge, common_curves
from grasp_cosim.comparison.side import Difference, Side, differences, read_side
from grasp_cosim.comparison.tube import Curve
from grasp_cosim.interface.units import Conversion
from report.runs import grasp_run

TIME = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
X = np.array([0.0, 1.0, 4.0, 9.0, 16.0])
ON = np.array([False, True, True, False, True])


def side(name="A", time=TIME, units=None, to_si=None, **signals):
    columns = {f"a.{key}": np.asarray(column) for key, column in (signals or {"x": X}).items()}
    known = {f"a.{key}": unit for key, unit in (units or {}).items()}
    return Side(name, time, columns, dict.fromkeys(columns) | known, to_si or {})


@pytest.mark.parametrize(
    ("begin", "end", "rows"),
    [
        (0.0, 0.4, [0, 1, 2, 3, 4]),
        (0.1, 0.3, [1, 2, 3]),
        (0.1 + 0.3e-9, 0.3 - 0.3e-9, [1, 2, 3]),
        (0.1 + 0.7e-9, 0.3 - 0.7e-9, [2]),
        (0.15, 0.15, []),
        (-1.0, 0.0, [0]),
        (0.4, 9.0, [4]),
    ],
)
def test_a_part_has_the_rows_of_its_ends_but_for_half_a_nanosecond(begin, end, rows):
    part = side().part(begin, end)
    assert part.time.tolist() == TIME[rows].tolist()
    assert part.signals["a.x"].tolist() == X[rows].tolist()


def test_every_second_row_and_the_ends():
    even, odd = side().every_second()
    assert even.signals["a.x"].tolist() == [0.0, 4.0, 16.0]
    assert odd.signals["a.x"].tolist() == [0.0, 1.0, 9.0, 16.0]
    even, odd = side(time=TIME[:4], x=X[:4]).every_second()
    assert even.time.tolist() == [0.0, 0.2, 0.3]
    assert odd.time.tolist() == [0.0, 0.1, 0.3]


def test_the_usual_time_between_two_rows():
    assert side(time=np.array([0.0, 0.1, 0.2, 0.3, 5.0])).interval == pytest.approx(0.1)
    assert side(time=TIME[:1], x=X[:1]).interval == 0.0
    assert side(time=TIME[:2], x=X[:2]).interval == 0.1
    assert repr(side()) == "Side A: 5 rows, 1 signal"
    assert repr(side(time=TIME[:1], x=X[:1], on=ON[:1])) == "Side A: 1 row, 2 signals"


def test_whole_numbers_and_booleans_are_held_and_what_is_far_is_as_far():
    far = [np.inf, -np.inf, 1e308, 2.0, np.nan]
    curves = side(x=far, on=ON, n=[1, 2, 3, 4, 5]).curves()
    assert {name: curve.held for name, curve in curves.items()} == {
        "a.x": False, "a.on": True, "a.n": True,
    }  # fmt: skip
    assert curves["a.x"].values[:4].tolist() == [1e300, -1e300, 1e300, 2.0]
    assert np.isnan(curves["a.x"].values[4])
    assert curves["a.on"].values.tolist() == [0.0, 1.0, 1.0, 0.0, 1.0]


@pytest.mark.parametrize("swapped", [False, True])
def test_what_is_held_in_one_run_is_held_in_both(swapped):
    sides = [side(on=ON, x=X, p=X), side("B", on=ON.astype(float), x=X, q=X)]
    references, candidates = common_curves(*(sides[::-1] if swapped else sides))
    assert [*references] == [*candidates] == ["a.on", "a.x"]
    assert candidates["a.on"].held
    assert not candidates["a.x"].held


MM = Conversion(1e-3, 0.0)


def test_a_log_takes_the_types_that_keep_its_values_and_the_units_it_does_not_tell():
    log = side("log.csv", on=[0.0, 1.0, 1.0, 0.0, 1.0], n=[0.5] * 5, x=X, y=X, own=X,
               units={"y": "m"})  # fmt: skip
    run = side("run", on=ON, n=[1, 2, 3, 4, 5], x=X, y=X, units={"x": "mm", "y": "mm"},
               to_si={"a.x": MM, "a.y": MM})  # fmt: skip
    like = log.like(run)
    assert like.signals["a.on"].dtype == np.bool_
    assert like.signals["a.n"].tolist() == [0.5] * 5
    assert (like.units["a.x"], like.units["a.y"], like.units["a.own"]) == ("mm", "m", None)
    assert like.to_si == {"a.x": MM}
    assert like.silent == ("a.on", "a.n", "a.x")


@pytest.mark.parametrize(
    ("own", "reference", "change"),
    [
        ("m", "m", (1.0, 0.0)), (None, "m", (1.0, 0.0)), ("m", None, (1.0, 0.0)),
        ("mm", "m", (1e3, 0.0)), ("m", "mm", (1e-3, 0.0)), ("degC", "K", (1.0, -273.15)),
        ("N", "m", None), ("ells", "m", None), ("m", "ells", None), ("ells", "ells", (1.0, 0.0)),
    ],
)  # fmt: skip
def test_a_unit_is_converted_where_both_are_known_and_of_one_quantity(own, reference, change):
    found = side(units={"x": own}).change("a.x", side("B", units={"x": reference}))
    assert found == (None if change is None else pytest.approx(change, rel=1e-12))


def test_converted_signals_and_those_that_cannot_be():
    changed = side(x=X, y=X, z=X).converted({"a.x": MM, "a.y": None})
    assert [*changed.signals] == ["a.x", "a.z"]
    assert changed.signals["a.x"].tolist() == (X * 1e-3).tolist()
    assert changed.signals["a.z"].tolist() == X.tolist()


def test_settings_are_told_in_words():
    a = grasp_run()
    assert differences(a, a) == ()
    changed = dict(a.settings)
    changed |= {"step": 2e-3, "scheme": "jacobi", "roles": {"plant": "gripper"}}
    found = {d.setting: (d.a, d.b) for d in differences(a, replace(a, settings=changed))}
    assert found["scheme"] == (a.settings["scheme"], "jacobi")
    assert found["step"] == (f"{a.settings['step']!r} s", "0.002 s")
    assert found["role plant"] == ("none", "gripper")
    assert {*found} == {"scheme", "step", "role plant", "case"}
    with pytest.warns(DeprecationWarning, match="is now Difference.setting"):
        assert Difference("step", "1", "2").what == "step"


# ------------------------------------------------------------------------- judged


def judged(reference, candidate, time=TIME, other=TIME, **stated):
    run = side(x=reference, time=time)
    sides = run, side("B", x=candidate, time=other)
    judge = Judge(run, [], Bands(signals={"*": Given(**stated)} if stated else {}), 0.0)
    return judge.signals(*common_curves(*sides))


def test_a_signal_is_judged_up_to_the_end_of_the_shorter_run():
    late = X.copy()
    late[4] = 99.0
    (whole,) = judged(X, late, absolute=1.0)
    assert (whole.inside, whole.deviation, whole.time) == (False, 83.0, 0.4)
    assert (whole.original, whole.candidate, whole.span) == (16.0, 99.0, 16.0)
    (short,) = judged(X, late[:4], other=TIME[:4], absolute=1.0)
    assert (short.inside, short.deviation) == (True, 0.0)
    (shorter,) = judged(X[:4], late, time=TIME[:4], absolute=1.0)
    assert (shorter.inside, shorter.deviation) == (True, 0.0)


@pytest.mark.parametrize(("width", "inside"), [(2.0, True), (1.9, False), (0.0, False)])
def test_a_deviation_may_be_as_large_as_its_band(width, inside):
    (signal,) = judged(X, X + np.array([0.0, 0.0, 2.0, 0.0, 0.0]), absolute=width)
    assert (signal.inside, signal.time) == (inside, 0.2)
    assert signal.ratio == (2.0 / width if width else np.inf)


def test_a_band_without_an_end_is_never_left_and_none_is_needed_for_the_same():
    (signal,) = judged(X, 2.0 * X, absolute=np.inf)
    assert (signal.ratio, signal.inside) == (0.0, True)
    (signal,) = judged(X, X, absolute=0.0)
    assert (signal.ratio, signal.inside) == (0.0, True)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_number_against_none_is_out_of_any_band(swapped):
    gap = X.copy()
    gap[[1, 3]] = np.nan
    (signal,) = judged(*((gap, X) if swapped else (X, gap)), absolute=1e9)
    assert (signal.deviation, signal.time, signal.inside) == (np.inf, 0.1, False)
    (both,) = judged(gap, gap, absolute=0.0)
    assert (both.deviation, both.inside) == (0.0, True)
    nowhere = np.full(5, np.nan)
    assert judged(nowhere, nowhere) == []


def test_a_signal_of_a_log_must_be_finite(tmp_path):
    (tmp_path / "log.csv").write_text("time,a.x,a.t\n0,1,one\n0.1,inf,two\n0.2,nan,2\n")
    log = read_side(tmp_path / "log.csv")
    with pytest.raises(InputError, match=r"log\.csv: a\.x at t = 0\.1 s: must be a finite number"):
        log.check_shared("a.x", side())
    with pytest.raises(InputError, match=r"log\.csv: line 2, column 3, a\.t = 'one'"):
        log.check_shared("a.t", side())


def test_a_curve_that_is_far_everywhere_has_no_range():
    assert Curve(TIME, np.full(5, 1e300)).range == (0.0, 0.0)
    assert Curve(TIME, np.array([1e300, -3.0, -1e300, 2.0, 1.0])).range == (-3.0, 2.0)


@pytest.mark.parametrize(
    ("begin", "common"), [(1.0, True), (0.99, True), (1.0 + 1e-8, False), (1.5, False)]
)
def test_one_time_in_common_is_enough(begin, common):
    run = grasp_run()
    end = float(run.time[-1])
    late = replace(run, time=run.time + end * begin, complete=True)
    if common:
        assert compare(run, late).begin == pytest.approx(end * begin)
    else:
        with pytest.raises(InputError, match="must have some time in common"):
            compare(run, late)


@pytest.mark.parametrize(
    ("held", "values"),
    [(False, [0.0, 0.0, 0.5, 1.0, 12.5, 16.0]), (True, [0.0, 0.0, 0.0, 1.0, 9.0, 16.0])],
)
def test_a_curve_between_its_samples_is_a_line_or_held(held, values):
    time = np.array([-1.0, 0.0, 0.05, 0.1, 0.35, 9.0])
    assert Curve(TIME, X, held).at(time).tolist() == pytest.approx(values)
    assert Curve(TIME, X, held).at(TIME - 0.4e-9).tolist() == pytest.approx(X, abs=1e-6)
