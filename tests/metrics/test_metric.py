"""What a metric is: signals by role, values in Python's own numbers, and why there is none."""

import pickle
import re
import sys
from types import ModuleType

import numpy as np
import pytest
from grasp_cosim import AnyOf, InputError, Realtime, metric, simulate
from grasp_cosim.grasp.metrics import METRICS
from grasp_cosim.metrics.groups import chosen
from grasp_cosim.metrics.metric import (
    RESERVED,
    MissingSignalError,
    Signals,
    check_portable,
    load_metrics,
    measure,
    needed,
)
from grasp_cosim.report.terminal import run_json

TIME = np.array([0.0, 0.5, 1.0])
GAP = np.array([0.3, 0.2, 0.1])
UNRECORDED = "; a signal that is no output must be recorded, --record "

FILE = '''"""My own."""

from statistics import mean

from grasp_cosim import metric
from grasp_cosim.grasp.metrics import time_difference

SHARE = 0.5


@metric("zeta", unit="m", entries=("begin", "end"))
def zeta(run):
    gap = run["plant.gap"]
    return gap[0], gap[-1]


@metric("alpha", unit="m")
def alpha(run):
    """Half of the mean of zeta."""
    return SHARE * mean(zeta(run))
'''


def signals(roles=None, component="plant"):
    return Signals(TIME, {f"{component}.gap": GAP, f"{component}.on": GAP < 0.15}, roles or {})


def made(name, function, **more):
    return metric(name, **more)(function)


# ------------------------------------------------------------------------- signals


def test_a_signal_is_found_by_the_role_of_its_component_and_by_its_name():
    run = signals({"plant": "gripper"}, "gripper")
    assert run["plant.gap"] is run["gripper.gap"] is run.by_name["gripper.gap"]
    assert "plant.gap" in run
    assert list(run) == ["gripper.gap", "gripper.on"]
    assert len(run) == 2
    swapped = Signals(TIME, {"plant.gap": GAP, "other.gap": 2 * GAP}, {"plant": "other"})
    assert swapped["plant.gap"] is swapped.by_name["other.gap"]


@pytest.mark.parametrize(
    ("name", "roles", "reason"),
    [
        (
            "plant.force",
            {},
            f"plant lacks force{UNRECORDED}plant.force; valid: plant.gap, plant.on",
        ),
        (
            "arm.force",
            {"arm": "plant"},
            f"plant lacks force{UNRECORDED}plant.force; valid: plant.gap, plant.on",
        ),
        ("arm.mass", {}, 'no component is the arm; name it under [roles]: arm = "..."'),
        ("arm.gap", {}, 'no component is the arm; name it under [roles]: arm = "plant"'),
        ("plan.gap", {}, 'no component is the plan; name it under [roles]: plan = "plant"'),
    ],
)
def test_a_signal_that_is_not_there_is_missed_with_the_reason(name, roles, reason):
    run = signals(roles)
    with pytest.raises(MissingSignalError) as caught:
        run[name]
    assert str(caught.value) == reason
    assert name not in run
    assert run.get(name) is None


# ------------------------------------------------------------------------- values


def test_values_come_in_the_order_of_their_metrics_with_their_units():
    found = measure(
        signals(),
        [
            made("zeta", lambda run: float(run["plant.gap"][-1]), unit="m"),
            made("alpha", lambda run: [1.0, None], unit="s", entries=("finger 1", "finger 2")),
            made("told", lambda run: True),
        ],
    )
    assert list(found.values.items()) == [("zeta", 0.1), ("alpha", [1.0, None]), ("told", True)]
    assert list(found.units.items()) == [("zeta", "m"), ("alpha", "s"), ("told", None)]
    assert [m.name for m in found.metrics] == ["zeta", "alpha", "told"]
    assert found.flat() == {"zeta": 0.1, "alpha[1]": 1.0, "alpha[2]": None, "told": True}
    assert list(found.flat()) == [c for m in found.metrics for c in m.columns]
    assert found.missing == ()


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (np.float32(0.5), 0.5),
        (np.int32(3), 3),
        (np.bool_(True), True),
        (np.array(0.5), 0.5),
        (np.array([0.5, 1.5]), [0.5, 1.5]),
        ((np.float64(0.5), None), [0.5, None]),
        ([np.int64(1), 2.5, False], [1, 2.5, False]),
        (None, None),
    ],
)
def test_numbers_become_pythons_own(value, plain):
    (found,) = measure(signals(), [made("x", lambda _: value)]).values.values()
    assert repr(found) == repr(plain)


@pytest.mark.parametrize(
    ("value", "entries", "message"),
    [
        ("fast", (), "returned 'fast'; must be a number, True, False, None or a list"),
        (1j, (), "returned 1j; must be a number"),
        ({"a": 1.0}, (), "returned {'a': 1.0}; must be a number"),
        ([[1.0]], (), "returned [[1.0]]; must be a number"),
        (np.ones((1, 2)), (), "returned array([[1., 1.]]); must be a number"),
        (1.0, ("a", "b"), "returned 1.0; must be a value for each of a, b"),
        ([1.0], ("a", "b"), "returned [1.0]; must be a value for each of a, b"),
        (None, ("a", "b"), "returned None; must be a value for each of a, b"),
        (float("nan"), (), "returned nan; must be finite, or None if there is no value"),
        ([1.0, np.float64("-inf")], (), "returned [1.0, "),
    ],
)
def test_another_value_is_refused(value, entries, message):
    line = rf"^metric 'x': test_metric\.py, line \d+: {re.escape(message)}"
    with pytest.raises(InputError, match=line) as caught:
        measure(signals(), [made("x", lambda _: value, entries=entries)]).check()
    assert "\n" not in str(caught.value)


def test_a_function_that_raises_is_a_wrong_input_that_names_it_and_its_line():
    def raising(_):
        raise ValueError("no\n  good")

    line = raising.__code__.co_firstlineno + 1
    said = f"metric 'own': test_metric.py, line {line}: ValueError: no good"

    found = measure(signals(), [made("own", raising), made("end", lambda run: run.time[-1])])
    assert found.missing == found.failures == (said,)
    assert (dict(found.values), found.units) == ({"end": 1.0}, {"end": None})
    for asked in (found.check, found.flat):
        with pytest.raises(InputError, match=f"^{re.escape(said)}$"):
            asked()


# ------------------------------------------------------------------------- what is missing


def grasp_signals():
    """Signals of a grasp that does not move, and one more."""
    names = {name for m in METRICS if not m.optional for name in m.reads} | {"controller.force[1]"}
    return Signals(TIME, {name: np.zeros(3) for name in sorted(names)})


def test_metrics_that_lack_the_same_are_named_in_one_line():
    whole = grasp_signals()
    part = {n: c for n, c in whole.by_name.items() if not n.startswith("plant.object_position")}
    own = made("carried", lambda _: 1.0, needs=("plant.object_position",))
    found = measure(Signals(TIME, part), [*METRICS, own])
    lost = ["object_shift", "object_drift"]
    assert [*found.values, *lost] == [m.name for m in METRICS if not m.optional]
    assert found.missing == (f"no {', '.join(lost)}, carried: plant lacks object_position",)


def test_of_a_group_the_rest_is_named_where_most_is_lost():
    """Of each group for itself: half of the first is there, of the second one of three."""
    first = [made(n, lambda _: 1.0, group="b", needs=(f"plant.{n}",)) for n in ("gap", "speed")]
    second = [
        made(n, lambda _: 1.0, group="a", needs=("plant.gap" if n == "q" else "plant.speed",))
        for n in ("p", "q", "r")
    ]
    assert measure(signals(), [*first, *second]).missing == (
        "no speed, metrics of the a but q: plant lacks speed",
    )
    assert measure(signals(), [*second, *first]).missing == (
        "no metrics of the a but q, speed: plant lacks speed",
    )
    assert measure(signals(), [first[1], second[0]]).missing == (
        "no metrics of the b, metrics of the a: plant lacks speed",
    )


def test_of_an_array_that_is_not_there_the_first_element_is_missed():
    touch = made("touch", lambda _: [0.0], needs=["plant.speed[*]"], entries=("finger *",))
    assert measure(signals(), [touch]).missing == ("no touch: plant lacks speed[1]",)


def test_a_grasp_whose_components_have_other_names_is_told_of_the_roles():
    run = grasp_signals()
    names = {"plant": "gripper", "controller": "law"}
    other = {
        f"{names[component]}.{variable}": column
        for (component, _, variable), column in ((n.partition("."), run[n]) for n in run)
    }
    line = "no {}: no component is the {}; name it under [roles]: {}".format
    controller = line("target_position", "controller", 'controller = "law"')
    missing = measure(Signals(run.time, other), METRICS).missing
    assert missing == (line("metrics of the grasp", "plant", 'plant = "gripper"'), controller)
    missing = measure(Signals(run.time, other, {"plant": "gripper"}), METRICS).missing
    assert missing == (controller,)
    missing = measure(Signals(run.time, other, {"controller": "law"}), METRICS).missing
    lost = "metrics of the grasp but target_position"
    assert missing == (line(lost, "plant", 'plant = "gripper"'),)
    roles = {"controller": "law", "plant": "gripper"}
    assert measure(Signals(run.time, other, roles), METRICS) == measure(run, METRICS)


def test_the_component_that_has_most_is_named_for_a_role():
    """Though it lacks what one of the metrics needs."""
    moves, feels = (made(n, lambda _: 1.0, needs=(f"arm.{n}",)) for n in ("gap", "force"))
    run = Signals(TIME, {"a.time": TIME, "plant.gap": GAP})
    assert measure(run, [moves, feels]).missing == (
        'no gap, force: no component is the arm; name it under [roles]: arm = "plant"',
    )


EITHER = AnyOf(("plant.gap[*]", "plant.contact[*]"))


@pytest.mark.parametrize(
    ("names", "elements", "reason"),
    [
        (("gap[1]", "gap[2]"), 2, None),
        (("contact[1]", "contact[2]", "contact[3]"), 3, None),
        (("gap[1]", "contact[1]", "contact[2]"), 1, None),
        (("speed[1]", "speed[2]"), 1, "plant has none of gap[1], contact[1]"),
    ],
)
def test_any_one_of_several_signals_will_do(names, elements, reason):
    """A metric has as many elements as the first of them that is there."""
    touch = made("touch", lambda _: [0.0] * elements, needs=[EITHER], entries=("finger *",))
    found = measure(Signals(TIME, {f"plant.{name}": GAP for name in names}), [touch])
    assert found.missing == ((f"no touch: {reason}",) if reason else ())
    assert [m.columns for m in found.metrics] == (
        [] if reason else [tuple(f"touch[{j}]" for j in range(1, elements + 1))]
    )


def test_signals_of_several_components_any_one_of_which_will_do_are_all_missed():
    own = made("own", lambda _: 1.0, needs=[AnyOf(("plant.force", "arm.force", "Alt"))])
    assert measure(signals(), [own]).missing == (
        "no own: plant lacks force and no component is the arm; name it under [roles]: "
        'arm = "..." and there is no signal Alt',
    )


def test_what_a_metric_uses_is_taken_where_it_is_there():
    touch = made(
        "touch", lambda _: [1.0], needs=[EITHER], uses=["plant.speed[*]", "plant.mass"], group="own"
    )
    names = ["arm.gap[1]", "arm.speed[1]", "arm.force[1]"]
    assert needed([touch], names, {"plant": "arm"}) == {"arm.gap[1]", "arm.speed[1]"}
    assert measure(Signals(TIME, {"plant.gap[1]": GAP}), [touch]).missing == ()


def test_a_metric_of_its_own_says_what_it_lacks():
    needing = made("speed", lambda run: run["plant.speed"][-1], needs=("plant.speed",))
    trying = made("force", lambda run: run["plant.force"][-1])
    silent = made("tilt", lambda run: run["plant.tilt"][-1], needs=("plant.tilt",), optional=True)
    there = made("gap", lambda run: run["plant.gap"][-1])
    found = measure(signals(), [needing, trying, silent, there])
    assert found.missing[0] == "no speed: plant lacks speed"
    line = "metric 'force': test_metric.py, line "
    assert found.missing[1].startswith(line)
    assert f": plant lacks force{UNRECORDED}plant.force; valid: " in found.missing[1]
    assert dict(found.values) == {"gap": 0.1}
    assert found.metrics == (there,)


def test_a_metric_that_says_why_others_have_no_value_is_left_out_without_one():
    values = {"a": None, "b": [None, None], "c": [1.0, None], "d": 2.0}
    found = measure(signals(), [made(n, lambda _, v=v: v, reason=True) for n, v in values.items()])
    assert dict(found.values) == {"c": [1.0, None], "d": 2.0}


# ------------------------------------------------------------------------- names


@pytest.mark.parametrize("name", ["", "rise time", "1st", "a.b", "gap[1]"])
def test_a_name_is_a_column_and_a_key(name):
    with pytest.raises(InputError, match=r"must be a name of letters, digits and _$"):
        metric(name)


def test_what_every_run_prints_is_no_name_of_a_metric(grasp):
    """No figure of `run --json` can take the place of a metric, or a metric that of one."""
    told = run_json(simulate(grasp, step=1e-3, stop=0.01, realtime=Realtime(factor=100.0)))
    assert "realtime" in told
    assert {*told} - {m.name for m in METRICS} <= RESERVED
    for name in RESERVED:
        with pytest.raises(InputError, match=f"^metric '{name}': is a figure of every run; must "):
            metric(name)


# ------------------------------------------------------------------------- files


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "mine.py"
        path.write_text(text, "utf-8")
        return path

    return write


def test_a_file_has_its_metrics_in_its_order_and_not_those_it_imports(file):
    zeta, alpha = load_metrics(file(FILE))
    assert (zeta.name, zeta.columns, alpha.name) == ("zeta", ("zeta[1]", "zeta[2]"), "alpha")
    assert dict(measure(signals(), [zeta, alpha]).values) == {
        "zeta": [0.3, 0.1],
        "alpha": 0.1,
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def f(:\n", "--metrics mine.py: SyntaxError: invalid syntax (mine.py, line 1)"),
        ("x = 0\0\n", "Error: source code string cannot contain null"),
        ("1 / 0\n", "--metrics mine.py, line 1: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(0)\n", "--metrics mine.py, line 2: SystemExit: 0"),
        (
            "import nowhere_at_all\n",
            "--metrics mine.py, line 1: ModuleNotFoundError: No module named ",
        ),
        ("x = 1\n", ": no metric; must have functions under @metric(name)"),
        (
            "from grasp_cosim.grasp.metrics import time_difference\n",
            ": no metric; must have functions under @metric(name)",
        ),
        (
            "from grasp_cosim import metric\nmetric('step')\n",
            "--metrics mine.py, line 2: metric 'step': is a figure of every run; must have",
        ),
        (
            "from grasp_cosim import metric\n\nmetric('way', unit='furlong')\n",
            "--metrics mine.py, line 3: metric 'way': unit 'furlong' is not known; must be one",
        ),
    ],
)
def test_a_file_without_metrics_is_one_line(file, text, message):
    path = file(text)
    for _ in range(2):  # what has failed once is not taken for done
        with pytest.raises(InputError) as caught:
            load_metrics(path)
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


def test_a_file_that_is_no_python_is_not_run(tmp_path):
    """It might do something all the same: system = ... is Python, too."""
    path = tmp_path / "ball.toml"
    path.write_text("raise_an_error_if_run", "utf-8")
    with pytest.raises(InputError, match=r"ball\.toml: must be a Python file, NAME\.py$"):
        load_metrics(path)


def test_a_file_that_cannot_be_read_is_one_line(tmp_path):
    path = tmp_path / "mine.py"
    with pytest.raises(InputError, match=r"mine\.py: No such file .*; must be a Python file$"):
        load_metrics(path)
    path.write_bytes(b"x = '\xff'\n")
    with pytest.raises(InputError, match=r"mine\.py: .*0xff.*; must be a Python file$"):
        load_metrics(path)


def test_ctrl_c_in_a_file_is_no_wrong_input(file):
    with pytest.raises(KeyboardInterrupt):
        load_metrics(file("raise KeyboardInterrupt\n"))


# ------------------------------------------------------------------------- other processes


@metric("at_end", unit="m")
def at_end(run):
    return float(run["plant.gap"][-1])


def test_a_metric_of_every_result_comes_back_as_itself():
    for m in METRICS:
        assert pickle.loads(pickle.dumps(m)).__reduce__() == m.__reduce__()
    assert pickle.loads(pickle.dumps(at_end)) is at_end


def test_a_metric_that_cannot_go_to_another_process_is_refused(monkeypatch):
    local = made("x", lambda _: 1.0)
    check_portable([at_end, local])  # with cloudpickle
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    with pytest.raises(InputError) as caught:
        check_portable([at_end, local])
    assert re.fullmatch(
        r"metric 'x': cannot go to another process \(.*\); must be a function in a module or in a "
        r"file of metrics, or cloudpickle be there: .* pip install '?cloudpickle'?",
        str(caught.value),
    )


# ------------------------------------------------------------------------- what is asked for


def widest(run):
    """The gap at its widest."""
    return float(run["plant.gap[1]"].max())


def test_a_metric_of_a_file_comes_back_by_the_text_of_the_file(file):
    zeta, alpha = load_metrics(file(FILE))
    for own in (zeta, alpha):
        back = pickle.loads(pickle.dumps(own))
        assert (back.name, back.unit, back.description) == (own.name, own.unit, own.description)
        assert measure(signals(), [back]).flat() == measure(signals(), [own]).flat()


def test_what_a_file_imports_is_none_of_its_metrics_whatever_the_module(file, monkeypatch):
    for name in ("aaa", "zzz"):
        module = ModuleType(name)
        exec(
            "from grasp_cosim import metric\n@metric('theirs')\ndef theirs(run):\n    return 1.0\n",
            module.__dict__,
        )
        monkeypatch.setitem(sys.modules, name, module)
    (own,) = load_metrics(
        file(
            "from aaa import theirs as a\nfrom zzz import theirs as z\n"
            "from grasp_cosim import metric\n@metric('own')\ndef own(run):\n    return 2.0\n"
        )
    )
    assert own.name == "own"


def test_what_a_metric_does_not_say():
    plain = metric("way")(lambda run: 1.0)
    assert (plain.unit, plain.factor, plain.shown_unit, plain.columns) == (
        None,
        1.0,
        None,
        ("way",),
    )
    assert (plain.optional, plain.reason, plain.group, plain.entries) == (False, False, "", ())


def test_a_function_is_a_metric_of_its_name_and_docstring():
    own = metric("own", unit="m", description="said")(widest)
    found, same = chosen([widest, own], (), (), {})
    assert (found.name, found.unit, found.description) == ("widest", None, "The gap at its widest.")
    assert (same, same.description) == (own, "said")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("time_to_contct", "'time_to_contct': no such metric; did you mean time_to_contact"),
        (
            "time_to_contact",
            "metrics: time_to_contact: is not available: no component is the plant; name it under "
            '[roles]: plant = "arm"',
        ),
        (
            "target_position",
            "metrics: target_position: is not available: controller lacks target_position",
        ),
        (3, "metrics: 3: must be a metric, a function or a name"),
        (lambda _: 1.0, "metric '<lambda>': must be a name"),
    ],
)
def test_what_is_no_metric_is_refused_in_one_line(asked, said):
    with pytest.raises(InputError) as raised:
        chosen([asked], ["grasp"], ("a.y", "arm.gap[1]", "controller.force[1]"), {})
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_run_has_them(grasp):
    result = simulate(grasp, step=1e-3, stop=0.01, metrics=[widest, "time_to_contact"])
    assert result.metrics["widest"] == pytest.approx(0.045)
    assert result.metrics["time_to_contact"] == [None, None]
    assert result.metric_units["widest"] is None
