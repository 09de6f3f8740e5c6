"""The CSV file of stimuli: what is read from it, and the line for each mistake."""

import math
import re
from array import array
from pathlib import Path

import pytest
from grasp_cosim import InputError, System, simulate
from grasp_cosim.system.parts import Port
from grasp_cosim.system.stimuli import Stimuli, Stimulus, read_stimuli
from grasp_cosim.system.validity import samples_of
from hypothesis import given
from hypothesis import strategies as st
from support.native_fmus import needs_gcc
from support.native_systems import driven

FORCE = Port("a", "u_Real")
INPUT = '[input]\nfile = "drive.csv"\n'


def read(folder, text):
    (folder / "drive.csv").write_text(text, "utf-8")
    return read_stimuli(folder / "drive.csv")


def test_names_are_quoted_or_not_and_rows_may_be_apart(tmp_path):
    found = read(tmp_path, '\ufeff"time", "a.u[1]",b.v\r\n0,1,2\r\n\r\n 0.5 , 1e3 ,-2.5\r\n')
    assert list(found.columns) == [Port("a", "u[1]"), Port("b", "v")]
    assert found.times == array("q", [0, 500_000_000])
    assert [list(c.samples) for c in found.columns.values()] == [[1.0, 1000.0], [2.0, -2.5]]
    assert found.place(Port("b", "v"), 1) == "drive.csv: line 4, column 3, b.v"


def test_a_place_is_that_in_the_file_whatever_it_is(tmp_path):
    found = read(tmp_path, "time,,a.u\n0,,1\n")
    assert found.place(Port("a", "u")) == "drive.csv: line 1, column 3, a.u"
    arrow = pytest.importorskip("pyarrow")
    table = arrow.table({"time": [0.0, 1.0], "a.u": [1.0, 2.0]})
    with arrow.ipc.new_file(tmp_path / "drive.arrow", table.schema) as file:
        file.write_table(table)
    found = read_stimuli(tmp_path / "drive.arrow")
    assert found.place(Port("a", "u")) == "drive.arrow: column 2, a.u"
    assert found.place(Port("a", "u"), 1) == "drive.arrow: row 2, column 2, a.u"


def test_a_time_may_be_in_another_unit(tmp_path):
    assert read(tmp_path, "time [ms],a.u\n-1,0\n2.5,0\n").times == array(
        "q", [-1_000_000, 2_500_000]
    )


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=8))
def test_numbers_are_read_as_they_are_written(values):
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        rows = "".join(f"{i},{value!r}\n" for i, value in enumerate(values))
        found = read(Path(folder), f"time,a.u\n{rows}")
    assert list(map(repr, found.columns[Port("a", "u")].samples)) == list(map(repr, values))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "drive.csv: is empty; must have names"),
        ("time\n0\n", "line 1, column 1 = 'time': must be time, then component.variable"),
        ("a.u,time\n0,1\n", "column 1 = 'a.u': must be time, then component.variable, with commas"),
        ("time,a.u\n", "drive.csv: has no row below its names; must have one"),
        ("time [m],a.u\n0,0\n", "line 1, column 1 = 'time [m]': must be in a unit of time"),
        ("time,.u\n0,0\n", "line 1, column 2 = '.u': must be 'component.variable'"),
        ("time,a.u,a.u\n0,0,0\n", "line 1, column 3 = 'a.u': appears twice"),
        ("time,a.u\n0\n", "line 2 has 1 cell; must have 2, as line 1"),
        ("time,a.u\n0,\n", "line 2, column 2, a.u: missing"),
        ("time,a.u,a.v\n0,1,one\n1,1, \n", "line 3, column 3, a.v: missing"),
        ("time,a.u\n0,inf\n", "line 2, column 2, a.u = inf: must be a finite number"),
        ("time,a.u\n0,0\nnow,0\n", "line 3, column 1, time = 'now': must be a number"),
        ("time,a.u\n0,0\nnan,0\n", "line 3, column 1, time = nan: must be a finite number"),
        ("time,a.u\n0,0\n2,0\n1,0\n", "line 4, column 1, time = 1.0: is before 2.0; must not fall"),
        ("time,a.u\n1_0,0\n", "line 2, column 1, time = '1_0': must be a number"),
        ("time,a.u\n1e10,0\n", "to 1e+10 s; must be at most 1e+09 s"),
        ('time,a.u\n0,"1\n', "after line 1: unexpected end of data; must be a CSV file"),
    ],
)
def test_a_mistake_in_the_file_is_one_line_with_its_place(text, said, tmp_path):
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        read(tmp_path, text)
    assert "\n" not in str(refused.value)


def test_what_is_no_such_file_is_said(tmp_path):
    with pytest.raises(InputError, match="No such file or directory; must be a CSV file"):
        read_stimuli(tmp_path / "none.csv")
    with pytest.raises(InputError, match="Is a directory; must be a CSV file"):
        read_stimuli(tmp_path)
    (tmp_path / "latin.csv").write_bytes(b"time,a.\xfc\n")
    with pytest.raises(InputError, match="can't decode byte 0xfc"):
        read_stimuli(tmp_path / "latin.csv")
    with pytest.raises(InputError, match=r"interpolation = 'cubic': must be one of linear, held"):
        read_stimuli(tmp_path / "none.csv", "cubic")


@needs_gcc
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "time,a.u_Real,a.w\n0,1,1\n",
            "column 3, a.w: no input or tunable parameter 'a.w'; valid: ",
        ),
        ("time,a.u_Real,b.w\n0,1,1\n", "line 1, column 3, b.w: no component 'b'; valid: a"),
        ("time,a.u_Real,a.x\n0,1,1\n", "column 3, a.x: is a continuous output"),
        ("time,a.u_Real\n0,1\n1,one\n", "line 3, column 2, a.u_Real: u_Real = 'one': must be"),
        ("time,a.u_Real [m]\n0,1\n", "a.u_Real [m]: cannot be converted into N"),
        ("time,a.u_Integer\n0,1\n1,1.5\n", "line 3, column 2, a.u_Integer: u_Integer = '1.5'"),
        ("time,a.u_Integer\n0,1\n1,3e9\n", "line 3, column 2, a.u_Integer: u_Integer = '300000"),
        ("time,a.u_Real\n0,1\n1,1_0\n", "line 3, column 2, a.u_Real: u_Real = '1_0': must be"),
        ("time,a.u_Real\n0,\u0661\n", "line 2, column 2, a.u_Real: u_Real = '\u0661': must be"),
        (
            "time,a.u_Integer\n0,1\n1,-9007199254740993\n",
            "line 3, column 2, a.u_Integer: u_Integer = '-9007199254740992': must be",
        ),
        ("time,a.u_Integer [N]\n0,1\n", "is of type Integer; must have no unit"),
        ("time,a.u_Boolean\n0,1\n1,2\n", "line 3, column 2, a.u_Boolean: u_Boolean = '2': must"),
        ("time,a.u_Enumeration\n0,3\n", "u_Enumeration = '3': must be one of one, two"),
        ("time,a.u_Enumeration\n0,1\n0,red\n", "line 3, column 2, a.u_Enumeration: u_Enumeration"),
        ("time,a.u_String\n0,red\n", "is of type String; must be a Real"),
    ],
)
def test_a_column_that_does_not_fit_is_one_line_with_its_place(text, said, tmp_path):
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        System.load(driven(tmp_path, text, more=INPUT))
    assert "\n" not in str(refused.value)


@needs_gcc
def test_a_whole_number_that_float64_may_not_have_is_refused(tmp_path):
    text = "time,a.u_Int64\n0,1\n1,9007199254740993\n"
    with pytest.raises(InputError, match=r"line 3, column 2, a\.u_Int64 = .*: must be small"):
        System.load(driven(tmp_path, text, "3.0", INPUT))


def test_numbers_before_the_first_text_are_texts_too(tmp_path):
    mixed = read(tmp_path, "time,a.u\n0,2.0\n0, 1\n0,red\n")
    assert mixed.columns[Port("a", "u")].texts == ("2.0", "1", "red")


@needs_gcc
def test_an_input_has_one_source(tmp_path):
    text = "time,a.u_Real\n0,1\n"
    system = System.load(driven(tmp_path, text, more=INPUT))
    drives = simulate(system)["a.y_Real"]
    assert (simulate(system.with_values({"a.u_Real": 2.0}))["a.y_Real"] == drives).all()
    event = '[[events]]\nat = 0.5\nset = { "a.u_Real" = 1.0 }\n'
    with pytest.raises(InputError, match=r"a.u_Real has two sources, drive.csv and an event"):
        System.load(driven(tmp_path, text, more=INPUT + event))
    path = driven(tmp_path, text, more=INPUT)
    connected = path.read_text().replace("= []", '= ["a.x -> a.u_Real"]')
    path.write_text(connected)
    with pytest.raises(InputError, match=r"sources, drive.csv and a connection, from a.x"):
        System.load(path)


@needs_gcc
def test_words_and_numbers_stand_for_values(tmp_path):
    text = (
        "time,a.u_Boolean,a.u_Enumeration,a.u_Integer,a.u_Real [kN]\n"
        "0,true,two,-3,1\n1,0,1,3.0,2\n2,1,two,1e3,0.5\n"
    )
    system = System.load(driven(tmp_path, text, more=INPUT))
    names = ["u_Boolean", "u_Enumeration", "u_Integer", "u_Real"]
    assert [list(samples_of(system, Port("a", name))) for name in names] == [
        [1.0, 0.0, 1.0],
        [2.0, 1.0, 2.0],
        [-3.0, 3.0, 1000.0],
        [1000.0, 2000.0, 500.0],
    ]


@needs_gcc
def test_a_file_given_goes_before_the_one_that_is_named(tmp_path):
    path = driven(tmp_path, "time,a.u_Real\n0,1\n", more=INPUT)
    (tmp_path / "other.csv").write_text("time,a.u_Real\n0,7\n", "utf-8")
    assert list(samples_of(System.load(path), FORCE)) == [1.0]
    other = System.load(path, input=tmp_path / "other.csv")
    assert list(samples_of(other, FORCE)) == [7.0]
    with pytest.raises(InputError, match=r"no source for a.u_Real.*--input"):
        other.with_input(None)


COLUMN = Stimulus(array("d", [1.0, 2.0]))


@pytest.mark.parametrize(
    ("times", "columns", "lines", "good"),
    [
        ([0, 1], {FORCE: COLUMN}, [], True),
        ([0, 1], {FORCE: COLUMN}, [2, 3], True),
        ([1, 1], {FORCE: COLUMN}, [2, 3], True),
        ([0, 1], {}, [], True),
        ([], {}, [], False),
        ([0, 1, 2], {FORCE: COLUMN}, [], False),
        ([0, 1], {FORCE: COLUMN}, [2], False),
        ([1, 0], {FORCE: COLUMN}, [2, 3], False),
        ([0, 1], {FORCE: Stimulus(array("d", [1.0, math.nan]))}, [], False),
        ([0, 1], {FORCE: Stimulus(array("d", [1.0, math.inf]))}, [2, 3], False),
        ([0, 1], {FORCE: Stimulus(array("d", [0.0, 1.0]), texts=("a", "b"))}, [], True),
        ([0, 1], {FORCE: Stimulus(array("d", [0.0, 2.0]), texts=("a", "b"))}, [2, 3], False),
        ([0, 1], {FORCE: Stimulus(array("d", [0.5, 1.0]), texts=("a", "b"))}, [], False),
    ],
)
def test_times_and_samples_that_no_file_could_have_are_refused(times, columns, lines, good):
    def made():
        return Stimuli("drive.csv", array("q", times), columns, lines=array("q", lines))

    if good:
        assert [*made().times] == times
    else:
        with pytest.raises(ValueError, match=r"drive\.csv: times and samples do not go together"):
            made()
