"""Of what is recorded besides the outputs, the log tells what is not as it was."""

import pytest
from grasp_cosim import System, simulate


@pytest.mark.parametrize("large", [2.0**53, 1e17, -1e17, 1e300])
def test_a_large_real_number_is_as_it_was(large):
    """A float64 has as many digits of it as of any other."""

    def put(t, inputs):
        return {"y": large}

    def take(t, inputs):
        return {}

    system = System(
        components={"a": put, "b": take},
        connections=["a.y -> b.u"],
        experiment={"step": 0.1, "stop": 0.5},
    ).with_record("*")
    result = simulate(system)
    assert result["b.u"].tolist() == [large] * 6
    assert not any("recorded" in line for line in result.log)
