"""A run ends with the row in which a signal ran away, wherever that is."""

import pytest
from grasp_cosim import SimulationError, System, simulate

STEPS_PER_DECADE = 10


def growing(begin=0):
    """A system whose only output is 1, and grows from a step on."""

    def grow(t, inputs):
        return {"y": 10.0 ** (max(round(t * 1e3) - begin, 0) / STEPS_PER_DECADE)}

    def watch(t, inputs):
        return {}

    return System(
        components={"a": grow, "b": watch},
        connections=["a.y -> b.u"],
        experiment={"step": 1e-3, "stop": 1.0},
    )


@pytest.mark.parametrize("begin", [0, 1, 2, 100, 127, 128, 200, 301])
@pytest.mark.parametrize("every", [1, 1000])
def test_the_last_row_is_that_at_which_it_ran_away(begin, every):
    with pytest.raises(SimulationError, match=r"^a\.y ran away: 1e\+0[67] at t = ") as caught:
        simulate(growing(begin), every=every)
    result = caught.value.result
    assert not result.complete
    step = round(result.time[-1] * 1e3)
    decades = (step - begin) / STEPS_PER_DECADE
    assert decades in (6.0, 7.0)
    assert result["a.y"][-1] == 10.0**decades
    assert len(result.time) == (step + 1 if every == 1 else 2)


def test_what_may_go_on_goes_on_and_is_told_once():
    result = simulate(growing().with_settings({"experiment.diverging": "continue"}))
    assert (result.complete, len(result.time)) == (True, 1001)
    (line,) = (line for line in result.log if "ran away" in line)
    assert line.endswith("; the run went on")
