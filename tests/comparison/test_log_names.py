"""A run and the log of another logger: other names, units, signs, and a clock that is off."""

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.base.errors import InputError
from grasp_cosim.comparison.compare import compare
from grasp_cosim.recording.log_names import LogColumn, LogNames, read_log_names
from scipy.interpolate import CubicSpline

MAP = """
[time]
column = "t"
unit = "ms"
offset = {offset}

[signals]
"plant.position[1]" = {{ column = "x right", unit = "mm" }}
"controller.force[1]" = {{ column = "F", factor = -1e-3, offset = 0.5 }}
"""


@pytest.fixture(scope="module")
def run(grasp):
    return simulate(grasp.with_experiment(step=1e-3, stop=2.0))


def write_log(folder, run, offset, rate=1.7e-3, noise=0.0):
    """A log that another clock has made, with semicolons and words beside the numbers."""
    times = np.arange(0.3, 1.7, rate)
    x, f = (CubicSpline(run.time, run[n])(times)
            for n in ("plant.position[1]", "controller.force[1]"))  # fmt: skip
    random = np.random.default_rng(1)
    x, f = x + random.normal(0.0, noise, len(x)), f + random.normal(0.0, noise, len(f))
    rows = zip((times - offset) * 1e3, x * 1e3, (0.5 - f) * 1e3, strict=True)
    lines = ["t;x right;F;remark", *(f"{t!r};{a!r};{b!r};ok" for t, a, b in
                                     ([float(v) for v in row] for row in rows))]  # fmt: skip
    path = folder / "bench.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def names(folder, offset):
    path = folder / "names.toml"
    path.write_text(MAP.format(offset=offset))
    return read_log_names(path)


def test_names_units_and_a_known_offset(run, tmp_path):
    found = compare(run, write_log(tmp_path, run, 12.5), names=names(tmp_path, 12.5))
    assert {s.name for s in found.signals} == {"plant.position[1]", "controller.force[1]"}
    assert found.alike
    assert any("compared from 0.3 to 1.69" in note for note in found.notes)


@pytest.mark.parametrize("offset", [0.0, 3.21, -0.123])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_offset_is_found(run, tmp_path, offset, noise):
    """To a part of a sample, also with noise of a tenth of a millimetre and of a millinewton."""
    log = write_log(tmp_path, run, offset, noise=noise)
    found = compare(run, log, names=names(tmp_path, '"fit"'))
    (line,) = (note for note in found.notes if "is off" in note)
    assert float(line.split(" s were")[0].split()[-1]) == pytest.approx(
        offset, abs=1e-4 + 4.0 * noise
    )


@pytest.mark.parametrize(
    ("x", "said"),
    [
        (lambda t: 0.1 + 0.0 * t, "no signal that A has, too, changes"),
        (lambda t: np.random.default_rng(2).normal(0.0, 1.0, len(t)), "are like those of A at no"),
    ],
)
def test_an_offset_that_is_not_determined_is_refused(run, tmp_path, x, said):
    times = np.arange(0.0, 1.5, 1e-3)
    rows = zip(times.tolist(), x(times).tolist(), strict=True)
    lines = ["time,plant.position[1]", *(f"{t!r},{v!r}" for t, v in rows)]
    path = tmp_path / "bench.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=said):
        compare(run, path, names=LogNames("names.toml", offset=None))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[times]", "unknown entry 'times'"),
        ("[time]\noffset = 'guess'", "time.offset = 'guess': must be a number of s, or \"fit\""),
        ("[time]\nunit = 'lightyear'", "time.unit = 'lightyear': is no known unit"),
        ("[signals]\na = 1", "signals.a"),
        ("[signals]\na = { unit = 'mm' }", "signals.a: column"),
        ("[signals]\na = { column = 'b', factor = 'x' }", "factor = 'x': must be a number"),
    ],
)
def test_maps_that_are_none(tmp_path, text, said):
    path = tmp_path / "names.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_log_names(path)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_column_that_is_not_there(run, tmp_path):
    log = write_log(tmp_path, run, 0.0)
    wrong = LogNames("n.toml", "t", "ms", 0.0, {"plant.position[1]": LogColumn("x left")})
    with pytest.raises(InputError, match=r"no column 'x left'; .*x right"):
        compare(run, log, names=wrong)
