"""What no other point beats."""

from itertools import pairwise

from grasp_cosim.tuning.search import non_dominated
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

SMALL = st.integers(0, 6).map(float)
PAIRS = st.lists(st.tuples(SMALL, SMALL), max_size=20)


def beats(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """True if a is nowhere worse than b, and somewhere better."""
    return a != b and all(x <= y for x, y in zip(a, b, strict=True))


@given(PAIRS)
@examples(200)
def test_it_is_all_that_nothing_beats_each_once(pairs: list[tuple[float, float]]) -> None:
    found = [pairs[i] for i in non_dominated(pairs)]
    assert set(found) == {p for p in pairs if not any(beats(q, p) for q in pairs)}
    assert found == sorted(set(found), key=lambda pair: pair[1])
    assert [pairs.index(p) for p in found] == non_dominated(pairs)  # of equals the first


@given(PAIRS)
@examples()
def test_along_it_less_of_one_is_more_of_the_other(pairs: list[tuple[float, float]]) -> None:
    found = [pairs[i] for i in non_dominated(pairs)]
    for before, after in pairwise(found):
        assert before[1] < after[1]
        assert before[0] > after[0]


def test_of_one_number_it_is_the_first_of_the_least() -> None:
    assert non_dominated([(3.0,), (1.0,), (1.0,)]) == [1]
    assert non_dominated([]) == []
