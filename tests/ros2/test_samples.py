"""Misses, late samples and the loss of peers, as they are counted."""

from grasp_cosim_ros.samples import Samples
from hypothesis import given
from hypothesis import strategies as st


def lockstep(tolerated=1):
    return Samples(["a", "b"], tolerated)


def test_a_step_takes_a_new_sample_of_each_topic():
    samples = lockstep()
    samples.take("a", {"x": 1.0}, 0)
    assert not samples.complete
    samples.take("b", {"y": 2.0}, 0)
    assert samples.complete
    assert samples.begin_step(0) == []
    assert not samples.complete
    assert samples.values == {"x": 1.0, "y": 2.0}
    assert (samples.count.steps, samples.count.misses) == (1, 0)


def test_one_miss_more_than_tolerated_is_the_loss():
    samples = lockstep(tolerated=2)
    samples.take("a", {"x": 1.0}, 0)
    assert [samples.begin_step(0) for _ in range(3)] == [[], [], ["a", "b"]]
    assert samples.count.misses == 3


def test_a_sample_between_misses_begins_their_count_again():
    samples = Samples(["a"], 1)
    for _ in range(10):
        assert samples.begin_step(0) == []
        samples.take("a", {}, 0)  # late: of the step before
        samples.take("a", {}, 0)
        assert samples.begin_step(0) == []
    assert samples.count.late == samples.count.misses == 10


def test_a_late_sample_is_the_newest_but_begins_no_step():
    samples = Samples(["a"], 3)
    samples.begin_step(0)
    samples.take("a", {"x": 1.0}, 0)
    assert not samples.complete
    assert samples.values == {"x": 1.0}
    assert samples.count.late == 1
    samples.take("a", {"x": 2.0}, 0)
    assert samples.complete
    assert samples.count.late == 1


def test_newer_samples_replace_older_ones():
    samples = lockstep()
    samples.take("a", {"x": 1.0}, 0)
    samples.take("a", {"x": 2.0}, 0)
    assert samples.values == {"x": 2.0}
    assert samples.count.skipped == 1


def test_lost_peers_owe_nothing_when_they_are_back():
    samples = Samples(["a"], 0)
    samples.begin_step(0)
    samples.lose()
    samples.take("a", {}, 0)
    assert samples.complete
    assert (samples.count.late, samples.count.losses) == (0, 1)


def test_by_the_clock_a_sample_counts_up_to_its_age():
    samples = Samples(["a"], 0, longest_age_ns=10)
    samples.take("a", {}, 100)
    assert samples.begin_step(105) == []
    assert samples.begin_step(110) == []
    assert samples.begin_step(111) == ["a"]


def test_by_the_clock_one_sample_after_misses_is_late():
    samples = Samples(["a"], 5, longest_age_ns=10)
    for now in (100, 120, 140):
        samples.begin_step(now)
    samples.take("a", {}, 150)
    assert samples.begin_step(150) == []
    samples.take("a", {}, 155)
    assert (samples.count.misses, samples.count.late) == (3, 1)


@given(
    st.integers(0, 4),
    st.lists(st.sampled_from(["a", "b", "step"]), max_size=60),
)
def test_a_loss_is_what_the_definition_says(tolerated, happened):
    """Compared with a list of the steps that had all of their own samples, sample by sample."""
    samples = lockstep(tolerated)
    owed, here, hits = {"a": 0, "b": 0}, set(), []
    for event in happened:
        if event != "step":
            if owed[event]:
                owed[event] -= 1
            else:
                here.add(event)
            samples.take(event, {}, 0)
            continue
        hits.append(here == {"a", "b"})
        for topic in {"a", "b"} - here:
            owed[topic] += 1
        here = set()
        is_lost = bool(samples.begin_step(0))
        last = hits[-tolerated - 1 :]
        assert is_lost == (len(last) == tolerated + 1 and not any(last))
        if is_lost:
            return
    assert samples.count.misses == hits.count(False)
