"""What was fitted, as a file, goes into a run: values, and drives that are weak and late."""

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.base.errors import InputError
from grasp_cosim.grasp.identification.fitted_values import with_fitted

FITTED = """
[values]
"plant.friction.coulomb[1]" = 0.25
[drives]
"gain[1]" = 0.5
"delay" = 0.008
"""


def written(folder, text=FITTED):
    path = folder / "values.toml"
    path.write_text(text)
    return path


def test_values_gains_and_the_delay_are_those_of_the_run(grasp, tmp_path):
    """The force that arrives is that of two steps before, of finger 1 half of it."""
    system = with_fitted(grasp.with_experiment(step=4e-3, stop=0.2), written(tmp_path))
    assert system.start("plant.friction.coulomb[1]") == 0.25
    result = simulate(system.with_record("controller.force[1]", "controller.force[2]",
                                         "plant.force[1]", "plant.force[2]"))  # fmt: skip
    for finger, gain in ((1, 0.5), (2, 1.0)):
        sent = result[f"controller.force[{finger}]"]
        arrived = result[f"plant.force[{finger}]"]
        np.testing.assert_allclose(arrived[3:], gain * sent[:-3], rtol=1e-12, err_msg=str(finger))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[value]", "unknown entry 'value'"),
        ('[drives]\n"gain[3]" = 1', "unknown entry 'gain[3]'"),
        ('[drives]\ndelay = "late"', "drives.delay = 'late': must be a number"),
        ('[values]\n"plant.mass" = 1', "values.toml: plant.mass"),
    ],
)
def test_files_that_are_none(grasp, tmp_path, text, said):
    with pytest.raises(InputError) as error:
        with_fitted(grasp, written(tmp_path, text))
    assert said in str(error.value)
