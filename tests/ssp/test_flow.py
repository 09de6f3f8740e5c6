"""The order of execution along the flow of the data, also of large systems."""

from types import SimpleNamespace

from grasp_cosim.ssp.flow import flow_order
from hypothesis import given
from hypothesis import strategies as st


def flowing(names, pairs):
    """The names in the order of execution, with connections between the pairs."""
    parts = [SimpleNamespace(name=name) for name in names]
    ends = [[SimpleNamespace(component=name) for name in pair] for pair in pairs]
    order = flow_order(parts, [SimpleNamespace(source=s, target=t) for s, t in ends])
    return [part.name for part in order]


@given(st.permutations("abcdefg"), st.lists(st.tuples(*2 * [st.sampled_from("abcdefg")])))
def test_none_waits_for_a_later_one_but_in_a_loop(names, pairs):
    reached = {name: {t for s, t in pairs if s == name} for name in names}
    for between in names:
        for behind in reached.values():
            behind |= reached[between] if between in behind else set()
    order = flowing(names, pairs)
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


def test_thousands_of_components_take_one_pass():
    """A chain against the order of the file, then pairs that go in a circle each."""
    names = range(6000)
    chain = [(i + 1, i) for i in names[:-1]]
    assert flowing(names, chain) == [*reversed(names)]
    circles = [(i, i ^ 1) for i in names]
    assert flowing(names, circles) == [*names]
