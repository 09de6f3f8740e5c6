"""What simulate(..., metrics=[...]) takes: metrics, functions, names."""

import pytest
from grasp_cosim import InputError, metric, simulate
from grasp_cosim.metrics.metric import chosen


def widest(run):
    """The gap at its widest."""
    return float(run["plant.gap[1]"].max())


def test_a_function_is_a_metric_of_its_name_and_docstring():
    (found,) = chosen([widest], (), (), {})
    assert (found.name, found.unit, found.description) == ("widest", None, "The gap at its widest.")


def test_a_metric_stays_what_it_is():
    own = metric("own", unit="m")(widest)
    assert chosen([own], (), (), {}) == (own,)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("time_to_contct", "'time_to_contct': no such metric; did you mean time_to_contact"),
        ("time_to_contact", "metrics: time_to_contact: is not available: "),
        (3, "metrics: 3: must be a metric, a function or a name"),
        (lambda _: 1.0, "metric '<lambda>': must be a name"),
    ],
)
def test_what_is_no_metric_is_refused_in_one_line(asked, said):
    with pytest.raises(InputError) as raised:
        chosen([asked], ["grasp"], ("a.y",), {})
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_run_has_them(grasp):
    result = simulate(grasp, step=1e-3, stop=0.01, metrics=[widest, "time_to_contact"])
    assert result.metrics["widest"] == pytest.approx(0.045)
    assert result.metrics["time_to_contact"] == [None, None]
    assert result.metric_units["widest"] is None
