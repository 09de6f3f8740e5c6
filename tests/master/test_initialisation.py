"""Values at t = 0: the order they are passed on in, algebraic loops, wrong declarations."""

from graphlib import CycleError, TopologicalSorter
from itertools import count

import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.master.initialisation import cut_loops
from grasp_cosim.system.parts import Connection, Initialisation, Port
from hypothesis import given as drawn
from hypothesis import strategies as st
from support.mocks import Mock, Run, make_system


@pytest.fixture
def mock(tmp_path):
    return lambda *args, **kwargs: Mock(tmp_path, *args, **kwargs)


def through(u, t):
    return u


def run(mocks, pairs, **more):
    """Each pair 'ab' is a connection from a's y to b's u."""
    connections = [Connection(Port(a, "y"), Port(b, "u")) for a, b in map(tuple, pairs)]
    return Run(make_system(mocks, connections, **more), mocks)


def test_values_propagate_against_the_order_of_execution(mock):
    mocks = [mock("c", through), mock("b", through), mock("a", lambda u, t: 7.0)]
    started = run(mocks, ["ab", "bc"])
    started.master.initialise()
    assert [started.signals()[f"{name}.y"] for name in "abc"] == [[7.0]] * 3


def test_each_port_is_passed_on_in_initialisation_mode(mock):
    b = mock("b", through)
    run([mock("a", lambda u, t: 1.0), b], ["ab"]).master.initialise()
    assert b.calls[0] == "enter"
    assert set(b.calls[1 : b.calls.index("exit")]) == {"send", "receive"}


def test_nothing_is_sent_that_no_output_has_put_out(mock):
    """a runs before its source: what it is sent is the source's value, not a zero."""
    a = mock("a", lambda u, t: 1.0 / u)
    a.u = 1.0  # the start value
    run([a, mock("b", lambda u, t: 5.0)], ["ba"]).master.initialise()
    assert a.u == 5.0


def test_a_ring_without_direct_feedthrough_is_no_loop(mock):
    mocks = [mock("a", lambda u, t: 3.0 + t, direct=False), mock("b", through)]
    started = run(mocks, ["ab", "ba"], initialisation=Initialisation("refuse"))
    started.master.initialise()
    assert mocks[0].u == mocks[1].u == 3.0
    assert started.master.log == []


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (2.0, "its start values solve it and are kept, to a relative residual of 0"),
        (0.0, "all its values are 0 and are kept, which solves it if its FMUs work out their"),
    ],
)
def test_a_loop_that_any_value_solves_keeps_its_start_and_says_so(mock, start, said):
    first = mock("a", through)
    first.u = start
    started = run([first, mock("b", through)], ["ab", "ba"])
    started.master.initialise()
    assert started.signals()["a.y"] == [start]
    (line,) = started.master.log
    assert f"a.u: {said}" in line


def test_two_loops_are_solved_together(mock):
    mocks = [
        mock("a", lambda u, t: 1.0 - 2.0 * u), mock("b", through),
        mock("c", lambda u, t: 3.0 + 0.5 * u), mock("d", through),
    ]  # fmt: skip
    started = run(mocks, ["ab", "ba", "cd", "dc"])
    started.master.initialise()
    signals = started.signals()
    assert signals["a.y"][0] == pytest.approx(1.0 / 3.0, rel=1e-9)
    assert signals["c.y"][0] == pytest.approx(6.0, rel=1e-9)
    (line,) = started.master.log
    assert line.startswith("2 algebraic loops at t = 0 through a.u, c.u: solved in ")


def test_a_dependency_that_is_not_declared_is_found_and_said(mock):
    liar = mock("a", lambda u, t: 2.0 * u, direct=False)
    started = run([liar, mock("b", through), mock("s", lambda u, t: 4.0)], ["sa", "ab"])
    started.master.initialise()
    assert started.signals()["b.y"] == [8.0]
    (line,) = started.master.log
    assert line.startswith("a.y changed at t = 0 with an input that it does not declare")


def test_an_output_that_changes_each_time_it_is_read_is_said(mock):
    """As the time of day does: nothing is connected to it, so it is no loop."""
    clock = count()
    started = run([mock("a", through), mock("b", lambda u, t: float(next(clock)))], ["ab"])
    started.master.initialise()
    assert started.master.log == ["b.y changes each time it is read"]


def test_a_failure_in_initialisation_is_a_wrong_input(mock):
    a = mock("a", through)
    a.statuses["receive"] = 3
    with pytest.raises(InputError, match="a: status 3") as caught:
        run([mock("b", lambda u, t: 1.0), a], ["ba"]).master.initialise()
    assert isinstance(caught.value.__cause__, SimulationError)


@pytest.mark.parametrize(
    ("output", "solution", "direct", "nominal"),
    [
        (lambda u, t: 1.0 - 5.0 * u, 1.0 / 6.0, True, 1.0),  # repeating it would diverge
        (lambda u, t: 1.0 - 0.5 * u, 2.0 / 3.0, None, 1.0),  # undeclared: it depends on all
        (lambda u, t: 1e-11 - 5.0 * u, 1e-11 / 6.0, True, 1.0),  # the start value 0 is none
        (lambda u, t: 2e-9 - u**3 / 1e-18, 1e-9, True, 1e-9),  # relative to the nominal value
    ],
)
def test_a_loop_is_solved_and_said(mock, output, solution, direct, nominal):
    mocks = [mock("a", output, direct=direct, nominal=nominal), mock("b", through, nominal=nominal)]
    started = run(mocks, ["ab", "ba"])
    started.master.initialise()
    assert started.signals()["b.y"][0] == pytest.approx(solution, rel=1e-6)
    (line,) = started.master.log
    assert line.startswith("algebraic loop at t = 0 through a.u: solved in ")


@pytest.mark.parametrize(
    ("output", "more", "loops", "said"),
    [
        (lambda u, t: 1.0 - 0.5 * u, {}, "refuse", r"a\.u -> a\.y -> b\.u -> b\.y -> a\.u; must"),
        (lambda u, t: u + 1.0, {}, "iterate", r"a\.u -> .* does not converge to a relative resid"),
        (lambda u, t: not u, {"kind": "Boolean"}, "iterate", r"a\.u is Boolean: only loops of R"),
        (lambda u, t: u + 1.0, {"direct": False}, "iterate", "do not settle, a loop through"),
        (
            lambda u, t: 2**53 + 1,
            {"kind": "Integer", "direct": False},
            "iterate",
            r"^a\.y = 9007199254740993 at step 0: must be smaller th",
        ),
    ],
)
def test_a_loop_is_refused(mock, output, more, loops, said):
    kind = {"kind": more["kind"]} if "kind" in more else {}
    mocks = [mock("a", output, **more), mock("b", through, **kind)]
    with pytest.raises(InputError, match=said):
        run(mocks, ["ab", "ba"], initialisation=Initialisation(loops)).master.initialise()


COMPONENTS = st.lists(st.tuples(*3 * [st.integers(0, 3)]), min_size=1, max_size=7)
"""Of each component the numbers of its outputs and inputs, and of inputs that are connected."""


def cut_one_by_one(graph, inputs):
    """The loops, each the first that a search from the beginning finds."""
    loops = []
    while True:
        try:
            TopologicalSorter(graph).prepare()
            return loops
        except CycleError as error:
            path = error.args[1]
            entry = next(port for port in path if port in inputs)
            at = path.index(entry)
            loops.append((*path[at:-1], *path[: at + 1]))
            graph[entry] = []


@drawn(COMPONENTS, st.randoms(use_true_random=False))
def test_loops_are_cut_in_one_search_where_one_by_one_cuts_them(components, chance):
    outputs = [(i, "y", j) for i, (given, _, _) in enumerate(components) for j in range(given)]
    graph, inputs = {}, set()
    for i, (_, taken, connected) in enumerate(components):
        taking = [(i, "u", j) for j in range(min(taken, connected))] if outputs else []
        inputs |= {*taking}
        graph |= {port: [chance.choice(outputs)] for port in taking}
        giving = [port for port in outputs if port[0] == i]
        graph |= {port: [u for u in taking if chance.random() < 0.7] for port in giving}
    again = {port: [*needed] for port, needed in graph.items()}
    assert cut_loops(graph, inputs) == cut_one_by_one(again, inputs)
    assert graph == again


def test_thousands_of_loops_take_one_search():
    pairs = range(4000)
    graph = {(i, "u"): [(i ^ 1, "y")] for i in pairs} | {(i, "y"): [(i, "u")] for i in pairs}
    loops = cut_loops(graph, {(i, "u") for i in pairs})
    assert loops[1] == ((2, "u"), (2, "y"), (3, "u"), (3, "y"), (2, "u"))
    assert len(loops) == 2000
