"""A sensor from its curve: the paper's numbers come back, and its standard errors are right."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, identify
from grasp_cosim.grasp.identification.sensor_curve import fit_curve, read_curve

PAPER = {"gain": 0.0024, "exponent": 1.1506, "offset": 0.35}
"""K in V.m^n, n and c in V of the fit in the paper; l_0 is 5 mm."""

GAPS = np.linspace(0.0, 0.1, 101)


def voltages(seed, noise=5e-3):
    exact = PAPER["gain"] / (GAPS + 0.005) ** PAPER["exponent"] + PAPER["offset"]
    return exact + noise * np.random.default_rng(seed).standard_normal(len(GAPS))


def test_the_standard_errors_are_those_of_many_fits():
    """Of 100 curves: the numbers scatter by them, so that 68 % are within one and 95 % in two."""
    fits = [fit_curve(GAPS, voltages(seed), 0.005, 1.0, "test") for seed in range(100)]
    found = np.array([(f.gain, f.exponent, f.offset) for f in fits])
    scores = (found - list(PAPER.values())) / np.array([f.errors for f in fits])
    within_one = (np.abs(scores) < 1.0).mean(axis=0)
    within_two = (np.abs(scores) < 1.96).mean(axis=0)
    three_sigma = 3.0 * np.sqrt(0.25 / 100.0)
    assert within_one == pytest.approx([0.683] * 3, abs=three_sigma)
    assert within_two == pytest.approx([0.95] * 3, abs=3.0 * np.sqrt(0.0475 / 100.0))
    assert np.abs(scores.mean(axis=0)) == pytest.approx([0.0] * 3, abs=0.3)
    assert np.mean([f.noise for f in fits]) == pytest.approx(5e-3, rel=0.03)


def test_the_fit_explains_as_much_as_that_of_the_paper():
    fits = [fit_curve(GAPS, voltages(seed), 0.005, 1.0, "test") for seed in range(50)]
    assert np.mean([fit.r_squared for fit in fits]) == pytest.approx(0.9992, abs=1e-4)


@pytest.mark.parametrize("exponent", [0.3, 1.0, 2.5])
@pytest.mark.parametrize("gain", [1e-5, 0.0024, 3.0])
def test_other_sensors(gain, exponent):
    """Without noise the numbers come back, of a face that is not white."""
    curve = 0.86 * gain / (GAPS + 0.004) ** exponent - 0.2
    fit = fit_curve(GAPS, curve, 0.004, 0.86, "test")
    assert (fit.gain, fit.exponent) == pytest.approx((gain, exponent), rel=1e-5)
    assert fit.offset == pytest.approx(-0.2, abs=1e-4 * np.ptp(curve))


def write(path, gaps=GAPS, volts=None, head="gap,voltage"):
    volts = voltages(3) if volts is None else volts
    lines = [f"{gap!r},{v!r}" for gap, v in zip(map(float, gaps), map(float, volts), strict=True)]
    path.write_text("\n".join([head, *lines, ""]))
    return path


def test_columns_are_in_their_units_and_in_any_order(tmp_path):
    path = tmp_path / "curve.csv"
    rows = [f"{1e3 * v},x,{1e3 * gap}" for gap, v in zip(GAPS, voltages(3), strict=True)]
    path.write_text("\n".join(["voltage [mV],remark,gap [mm]", *rows]))
    gaps, volts = read_curve(path)
    assert gaps == pytest.approx(GAPS)
    assert volts == pytest.approx(voltages(3))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gap,voltage\n0,1\n1,0.5\n2,0.4\n3,0.3\n", ": 4 different gaps; must be at least 5"),
        ("gap,voltage\n" + "0,1\n" * 9, ": 1 different gap; must be at least 5"),
        ("gap,voltage\n0,1\n-0.001,2\n", ": line 3: gap = -0.001 m: must be finite, and 0 or more"),
        ("gap,voltage\n0,1\nnan,2\n", ": line 3: gap = nan m: must be finite, and 0 or more"),
        ("gap,voltage\n0,nan\n", ": line 2: voltage = nan V: must be finite"),
        ("gap,volts\n0,1\n", ": the columns are gap, volts, without voltage; must be gap, voltage"),
        ("gap [V],voltage\n0,1\n", "gap [V]: cannot be converted into m; must"),
        ("gap,voltage\n", "has no line below its columns; must have voltages over gaps"),
        ("gap,voltage\n0,0.1\n1,0.1\n2,0.1\n3,0.1\n4,0.1\n", ": the voltages do not determine"),
        ("gap,voltage\n0,0.1\n1,0.2\n2,0.3\n3,0.4\n4,0.5\n", ": the voltages do not determine"),
    ],
)  # fmt: skip
def test_a_wrong_curve_is_one_line(tmp_path, text, said):
    path = tmp_path / "curve.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        identify(path, fit=["sensor"])
    assert said in str(error.value).replace(r"\[", "[")
    assert "\n" not in str(error.value)


def test_the_command_writes_values_residuals_and_a_picture(command, grasp):
    pytest.importorskip("matplotlib")
    write(Path("curve.csv"))
    code, out, err = command(
        "identify", "curve.csv", "--fit", "sensor", "--out", "fitted", "--json"
    )
    assert (code, err) == (0, "")
    report = json.loads(out)
    found = {p["name"]: p for p in report["parameters"]}
    for j in (1, 2):
        for name, true in (
            (f"sensor_{j}.gain", PAPER["gain"]),
            (f"sensor_{j}.diffusion_exponent", PAPER["exponent"]),
            (f"sensor_{j}.ambient.offset", PAPER["offset"]),
            (f"controller.reflectance.diffusion_exponent[{j}]", PAPER["exponent"]),
        ):
            error = found[name]["standard_error"]
            assert found[name]["value"] == pytest.approx(true, abs=3.0 * error)
    assert len(report["rows"]) == len(GAPS)
    files = {path.name for path in Path("fitted").iterdir()}
    assert files == {"values.toml", "residuals.csv", "sensor_curve.png"}
    text = Path("fitted/values.toml").read_text()
    values = tomllib.loads(text)["values"]
    fitted = grasp.with_values(values)
    assert fitted.start("sensor_2.diffusion_exponent") == pytest.approx(1.15, abs=0.03)
    assert '# "controller.reflectance.gain[1]" = ' in text


def test_what_is_known_is_that_of_the_system_and_a_finger_may_be_chosen(command):
    exact = 0.5 * 0.0024 / (GAPS + 0.004) ** 1.2 + 0.1
    write(Path("curve.csv"), volts=exact)
    known = ("--set", "sensor_2.offset_distance=4 mm", "--set", "sensor_2.reflectance=0.5")
    code, out, _ = command("identify", "curve.csv", "--fit", "sensor[2]", *known)
    assert code == 0
    assert '"sensor_2.gain" = 0.0024  #' in out
    assert '"sensor_2.diffusion_exponent" = 1.2  #' in out
    assert '"sensor_2.offset_distance" = 0.004  # m, known' in out
    assert "sensor_1" not in out


@pytest.mark.parametrize("fit", [["sensor", "coulomb"], ["sensor[3]"], ["sensor[1]", "sensor[2]"]])
def test_a_curve_determines_a_sensor_and_nothing_else(tmp_path, fit):
    with pytest.raises(InputError, match="a curve determines a sensor and nothing else"):
        identify(write(tmp_path / "curve.csv"), fit=fit)


def test_a_sensor_needs_a_curve():
    with pytest.raises(InputError, match="needs a table with the columns gap and voltage"):
        identify(fit=["sensor"])
