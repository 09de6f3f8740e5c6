"""Who gives goes before who takes; within a loop, and else, as given."""

from itertools import pairwise
from types import SimpleNamespace

import pytest
from grasp_cosim.ssp.decisions import flow_order
from hypothesis import given
from hypothesis import strategies as st


def ordered(names, connections):
    """Of components of one letter, and connections like "ab"."""
    parts = [SimpleNamespace(name=name) for name in names]
    ends = [[SimpleNamespace(component=name) for name in pair] for pair in connections]
    found = flow_order(parts, [SimpleNamespace(source=s, target=t) for s, t in ends])
    return "".join(part.name for part in found)


@pytest.mark.parametrize(
    ("names", "connections", "order"),
    [
        ("", [], ""),
        ("cab", [], "cab"),
        ("cab", ["ab", "bc"], "abc"),
        ("cab", ["bc"], "abc"),
        ("abc", ["aa", "ba"], "bac"),
        ("abcd", ["bc", "cb", "ca", "db"], "dbca"),
        ("abcd", ["da", "db", "bc", "ca", "bd"], "bdca"),
    ],
)
def test_orders(names, connections, order):
    assert ordered(names, connections) == order


@given(st.permutations("abcdefg"), st.lists(st.tuples(*2 * [st.sampled_from("abcdefg")])))
def test_none_waits_for_a_later_one_but_in_a_loop(names, pairs):
    reached = {name: {t for s, t in pairs if s == name} for name in names}
    for between in names:
        for behind in reached.values():
            behind |= reached[between] if between in behind else set()
    order = ordered("".join(names), ["".join(pair) for pair in pairs])
    assert sorted(order) == sorted(names)
    for i, name in enumerate(order):
        assert not any(name in reached[o] and o not in reached[name] for o in order[i + 1 :])
        free = [
            n
            for n in names
            if n in order[i:]
            and not any(n in reached[o] and o not in reached[n] for o in order[i:])
        ]
        assert name == free[0]


def test_a_thousand_are_ordered_at_once():
    names = [chr(0x4E00 + i) for i in range(5000)]
    chain = [f"{later}{earlier}" for earlier, later in pairwise(names)]
    assert ordered("".join(names), chain) == "".join(reversed(names))
