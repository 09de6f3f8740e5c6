"""What docs/layers.md, limits.md and your_plant.md say is what their commands give."""

import importlib.util
import math
import re
import runpy
import shlex
import subprocess
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from grasp_controller import series
from grasp_controller.impact_reduction import Params as Layer2
from grasp_controller.simultaneous_contact import Params as Layer3
from grasp_cosim import System, cli, simulate
from grasp_cosim.recording.load import load_run
from gripper_plant.friction import Params as Friction
from support.native_fmus import needs_gcc
from support.pictures import assert_same_picture
from support.vendor import vendor_plant

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BLOCKS = re.compile(r"```(console|toml|python)\n(.*?)```", re.DOTALL)


INDENTED = [
    command
    for name in ("colour", "layers", "limits", "your_plant")
    for command in re.findall(
        r"^    (grasp-cosim .*?)(?:\s+#.*)?$",
        (DOCS / f"{name}.md").read_text("utf-8"),
        re.MULTILINE,
    )
]


def load_tutorials():
    spec = importlib.util.spec_from_file_location("tutorials", DOCS / "tutorials.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def page(name):
    return (DOCS / f"{name}.md").read_text("utf-8")


def said(name, pattern):
    """The numbers in the one place of a page that a pattern describes, line ends as spaces."""
    (found,) = re.findall(pattern, " ".join(page(name).split()))
    return [float(x) for x in ([found] if isinstance(found, str) else found)]


def checked(name, checkout):
    """The runs of the tables of a page, whose cells and pictures must be those of the runs.

    The cells must be the same to the printed digit: the runs are deterministic. Maps are
    of docs/colour_studies.py.
    """
    tutorials, text = load_tutorials(), page(name)
    do = tutorials.recorder(checkout / "recorded")
    drawn = checkout / "drawn"
    drawn.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", tutorials.DATE)
        found, tables = tutorials.worked_out(text, do)
        assert found == text, "run: docs/tutorials.py"
        tutorials.PAGES[name](tables, drawn)
    pictures = [p.name for p in drawn.iterdir()]
    maps = {"colour_map.png"}
    shown = re.findall(r"!\[.*?\]\((.*?)\)", page(name))
    assert sorted(set(shown) - maps) == sorted(pictures)
    for picture in pictures:
        assert_same_picture(drawn / picture, DOCS / picture, "docs/tutorials.py")
    return tables, do


@pytest.mark.slow
def test_the_commands_at_the_beginnings_work(checkout):
    assert {command.split()[1] for command in INDENTED} == {"build", "run"}
    for command in INDENTED:
        short = ["--stop", "0.01"] if command.split()[1] == "run" else []
        assert cli.main([*shlex.split(command)[1:], *short]) == 0, command
    assert (checkout / "case_0/grasp.png").is_file()


@pytest.mark.slow
def test_layers(checkout):
    (cases, _, _, cup), _ = checked("layers", checkout)
    case_0, case_1, case_2 = (cases[f"--case {case}"].metrics for case in "012")
    assert said("layers", r"K_i·W/2 = ([\d.]+) N") == [98.0 * 0.07 / 2.0]
    assert case_0["steady_contact_force"] == pytest.approx([3.43, 3.43], abs=1e-6)
    assert said("layers", r"(\d+) and (\d+) times slower") == [
        round(fast / slow)
        for fast, slow in zip(case_0["impact_velocity"], case_1["impact_velocity"], strict=True)
    ]
    assert said("layers", r"is there ([\d.]+) s before") == [round(case_1["time_difference"], 1)]
    assert said("layers", r"before, and ([\d.]+) s apart") == [round(case_2["time_difference"], 2)]
    assert said("layers", r"balance, at (\d+)°") == [round(math.degrees(math.atan(0.07 / 0.1)))]
    in_the_end = 2.0 * 98.0 * 0.035 / (98.0 + 1000.0)  # each side's spring against layer 1's
    assert said("layers", r"by ([\d.]+) mm in the end") == [round(1e3 * in_the_end, 1)]
    assert cup["0"].signals["plant.squeeze"][-1] == pytest.approx(in_the_end, rel=1e-3)


def test_the_switch_in_a_system_file_makes_case_1(checkout, grasp):
    (switch,) = (block for kind, block in BLOCKS.findall(page("layers")) if kind == "toml")
    text = (ROOT / "orchestrator/grasp_cosim/grasp/grasp.toml").read_text("utf-8")
    text = text.replace('fmu = "', 'fmu = "fmus/build/')
    head, _, _ = text.partition("[components.controller]")
    (checkout / "my_system.toml").write_text(head + switch, encoding="utf-8")
    system = System.load(checkout / "my_system.toml")
    assert system.component("controller", "test").values == {"simultaneous_contact.enabled": False}


@pytest.mark.slow
@pytest.mark.campaign
def test_colour(checkout):
    """The tables, and what the words say."""
    assert cli.main(["build", "docs/moving_object.py"]) == 0
    tables, _ = checked("colour", checkout)
    laws, others, free, drift, _, sensors, stripes, saturated, near, dark, *last = tables
    friction, moving = last
    assert_moving(moving)
    apart = said("colour", r"is there ([\d.]+) s before the other")
    assert apart == [round(laws["published"].metrics["time_difference"], 2)]
    for ratio in ("0.3", "0.86", "1", "1.2"):
        learnt = others[ratio].signals["controller.reflectance_ratio"][-1]
        assert learnt == pytest.approx(float(ratio), rel=0.01)
    assert max(free[mass].metrics["object_shift"] for mass in ("0.05", "0.02")) < 2e-3
    late, equal, published = list(drift.values())[3:]
    worse = [run.metrics["time_difference"] for run in (late, equal, published)]
    assert worse[0] > 0.1 > worse[1] > worse[2]
    forces = [run.metrics["force_difference"] for run in (equal, published)]
    assert forces[0] < 0.2 * forces[1]
    both = "diffusion_exponent=1.3 --set sensor_2.diffusion_exponent=1.3"
    one = sensors["diffusion_exponent=1.25"].metrics["time_difference"]
    assert sensors[both].metrics["time_difference"] < 0.03 < 0.1 < one
    by_period = {p: stripes[p].metrics["time_difference"] for p in ("0.005", "0.02", "0.1")}
    assert max(by_period, key=lambda p: by_period[p]) == "0.02"
    blind, blind_published = list(saturated.values())[2:]
    assert blind.metrics["time_difference"] > blind_published.metrics["time_difference"]
    assert min(run.metrics["impact_velocity"][1] for run in (blind, blind_published)) > 0.06
    published = " --set sensor_1.reflectance=1 --controller published"
    for place in ("0.07", "0.05 --set plant.object_width=0.08"):
        late, late_published = (near[f"{place}{law}"] for law in ("", published))
        assert late.metrics["time_difference"] == pytest.approx(
            late_published.metrics["time_difference"], abs=0.02
        )
    (alpha, gap, seen, noise) = said(
        "colour", r"At ([\d.]+) the light of a gap of (\d+) mm is (\d+) mV, .*?one sample, (\d+) mV"
    )
    assert seen == round(1e3 * 0.0024 * alpha / (1e-3 * gap + 0.005) ** 1.1506)
    assert noise == 5.0
    assert dark["0.1"].metrics["time_difference"] < 0.03 < dark["0.05"].metrics["time_difference"]
    alike = [friction[f].metrics["time_difference"] for f in list(friction)[1::2]]
    assert alike[0] == pytest.approx(alike[1], abs=0.01)


def assert_moving(moving):
    """Half the speed that is given keeps the fingers within 0.1 s; equal faces do not help."""
    apart = [run.metrics["time_difference"] for run in moving.values()]
    assert [1e3 * float(speed) for speed in list(moving)[:2]] == [0.5, 1.0]
    assert said("colour", r"From about (\d+) mm/s on the fingers are more than 0.1") == [1.0]
    assert apart[0] < 0.1 < apart[1] < apart[2]
    adaptive, published = apart[-2:]
    assert published < 0.1 < adaptive


def test_an_object_that_moves_is_a_fixed_one_seen_from_it():
    """Fingers that are pushed evenly, m·x'' = u, until the right one is stopped by the object."""
    block = runpy.run_path(str(DOCS / "moving_object.py"))
    p = block["Params"](initial_object_position=0.0, object_velocity=0.05)
    u = block["Inputs"]((-0.5, 0.25))
    x = block["initial_state"](p, u)
    for _ in range(20):
        x = block["step"](p, x, u, 0.01)
    y = block["outputs"](p, x, u)
    assert y.position == pytest.approx((0.11 - 0.5 * 0.2**2, -0.11 + 0.25 * 0.2**2), abs=1e-12)
    assert y.velocity == pytest.approx((-0.2, 0.1), abs=1e-12)
    assert y.object_position == pytest.approx(0.01, abs=1e-12)
    assert y.gap == pytest.approx((0.045, 0.075), abs=1e-12)
    for _ in range(200):
        x = block["step"](p, x, u, 0.01)
    y = block["outputs"](p, x, u)
    assert y.contact[0]
    assert y.velocity[0] == pytest.approx(0.05, abs=1e-6)
    assert y.position[0] == pytest.approx(y.object_position + 0.035, abs=1e-4)
    with pytest.raises(ValueError, match="friction: must be 0"):
        block["Params"](friction=Friction(coulomb=(1.0, 0.0)))


@pytest.mark.slow
def test_limits(checkout):
    assert cli.main(["build", "docs/quotient_controller.py"]) == 0
    tables, do = checked("limits", checkout)
    reflectances, carried, converter, _, *noise, friction, loop, near, _ = tables
    assert_reflectances(reflectances, do)
    assert_formulas(carried, converter, friction)
    assert_noise(*noise)
    assert_loop(loop)
    headings = re.findall(r"^## (.*)$", page("limits"), re.MULTILINE)
    assert "You see eight ways" in page("limits")
    assert len(headings) == 9
    assert headings[-1] == "What is no limit"
    place = r"at (\d+) mm the nearer one has (\d+) mm to go, at (\d+) mm (\d+) mm"
    assert said("limits", place) == [
        round(1e3 * x)
        for place in ("0.068", "0.074")
        for x in (float(place), near[place].signals["plant.gap[1]"][0])
    ]


def assert_reflectances(reflectances, do):
    """The ratios up to which the fingers are within 0.1 s, and not beyond."""
    apart = {ratio: run.metrics["time_difference"] for ratio, run in reflectances.items()}
    assert said("limits", r"From ([\d.]+) to ([\d.]+) the fingers are within 0.1 s") == [0.9, 1.14]
    assert max(apart["0.9"], apart["1.14"]) <= 0.1 < min(apart["0.89"], apart["1.15"])
    assert said("limits", r"in the middle, from ([\d.]+) to ([\d.]+)\.") == [0.885, 1.13]
    line = "grasp-cosim run --step 2e-3 --stop 2.2 --set plant.initial_object_position=0"
    inside, outside = (
        [do(f"{line} --set sensor_1.reflectance={r}").metrics["time_difference"] for r in ratios]
        for ratios in ((0.885, 1.13), (0.88, 1.14))
    )
    assert max(inside) <= 0.1 < min(outside)
    for ratio, run in reflectances.items():
        r = float(ratio.partition(" ")[0]) if "gain" not in ratio else 1.0
        behind = 5e-3 * (max(r, 1.0 / r) ** (1.0 / 1.1506) - 1.0)
        later = 2 if run.metrics["time_to_contact"][0] < run.metrics["time_to_contact"][1] else 1
        found = np.interp(
            min(run.metrics["time_to_contact"]), run.time, run.signals[f"plant.gap[{later}]"]
        )
        assert found == pytest.approx(behind, abs=0.3e-3)  # what the target is behind


def assert_formulas(carried, converter, friction):
    """What the page derives from the equations, worked out here once more."""
    f_s = 3.0 * math.tanh(0.14 / 1.86)
    (mass,) = said("limits", r"here from ([\d.]+) kg on")
    assert mass == round(2.0 * 98.0 * f_s / 36.0 / (0.3 * 9.80665), 3)
    for m, run in carried.items():
        speed = max(0.0, f_s - 36.0 * 0.3 * float(m) * 9.80665 / (2.0 * 98.0)) / 12.0
        position = run.signals["plant.object_position"]
        assert (position[-251] - position[-1]) / 0.5 == pytest.approx(speed, abs=0.2e-3)
    assert said("limits", r"K/l_0\^n = ([\d.]+) V") == [round(0.0024 / 0.005**1.1506, 2)]
    for volts in ("0.9", "0.5"):
        blind = (0.0024 / float(volts)) ** (1.0 / 1.1506) - 0.005
        signals = converter[volts].signals
        free = ~signals["plant.contact[1]"].astype(bool) & (signals["plant.gap[1]"] < 0.02)
        slowest = np.argmax(np.where(free, signals["plant.velocity[1]"], -np.inf))
        assert signals["plant.gap[1]"][slowest] == pytest.approx(blind, abs=0.1e-3)
    (holds,) = said("limits", r"Friction above K_i·W/2 = ([\d.]+) N")
    assert holds == pytest.approx(98.0 * 0.035, abs=1e-12)
    assert friction["5"].signals["plant.gap[1]"][-1] == pytest.approx(5.0 / 98.0 - 0.035, abs=2e-4)
    assert not friction["5"].signals["plant.contact[1]"].any()


def assert_noise(held, moving, dark):
    """What noise leaves in f_p, worked out here once more, and what the fingers make of it."""
    swap = " --swap controller=fmus/build/QuotientController.fmu"
    for options, run in held.items():
        h, ends = run.time[1] - run.time[0], (run.time[-1] - run.time[0])
        for j, d_p in ((1, 0.6), (2, -0.6)):
            xi = run.signals[f"sensor_{j}.intensity"]
            mean = run.signals[f"controller.impact_reduction_force[{j}]"][1:].mean()
            if not options.endswith(swap):
                assert mean == pytest.approx(d_p * math.log(xi[-1] / xi[0]) / ends, rel=1e-9)
                continue
            assert mean == pytest.approx(d_p * np.mean(1.0 - xi[:-1] / xi[1:]) / h, rel=1e-9)
            s, r_1 = xi.std() / xi.mean(), np.corrcoef(xi[1:], xi[:-1])[0, 1]
            formula = -d_p * s**2 * (1.0 - r_1) * (1.0 + 3.0 * s**2) / h
            assert mean == pytest.approx(formula, rel=0.1)
    sigma, at_1, at_2 = said("limits", r"sigma = ([\d.]+) mV; .* back (\d+) mV .* start, (\d+) mV")
    signals = held["--step 1e-3 --stop 10"].signals
    for j, volts in ((1, at_1), (2, at_2)):
        assert round(1e3 * signals[f"sensor_{j}.intensity"].mean()) == volts
        assert round(1e3 * signals[f"sensor_{j}.intensity"].std(), 1) == sigma
    fine, coarse = (moving[f"--step {h}"].metrics["time_to_contact"] for h in ("1e-4", "1e-3"))
    assert coarse == pytest.approx(fine, abs=1e-3)
    early = [max(moving[f"--step {h}{swap}"].metrics["time_to_contact"]) for h in ("1e-3", "1e-4")]
    assert early[0] < early[1] < min(fine)
    good, bad, mended = (max(run.metrics["impact_velocity"]) for run in dark.values())
    assert max(good, mended) < 0.01 < bad


def test_the_quotient_controller_differs_in_layer_2_alone():
    block = runpy.run_path(str(DOCS / "quotient_controller.py"))
    u = block["Inputs"](intensity=(0.05, 0.02))
    later = u._replace(position=(0.1, -0.1), intensity=(0.1, 0.025))
    for layers in product((False, True), repeat=2):
        p = series.Params(Layer3(enabled=layers[0]), Layer2(enabled=layers[1]))
        x = series.initial_state(p, u)
        ours, its = series.step(p, x, later, 1e-3), block["step"](p, x, later, 1e-3)
        assert its.impact_reduction_force == pytest.approx((300.0, -120.0), rel=1e-12)
        assert (
            its._replace(virtual=ours.virtual, impact_reduction_force=ours.impact_reduction_force)
            == ours
        )
        assert (its.virtual == ours.virtual) is not layers[1]


def assert_loop(loop):
    """Steps of 20 ms go well; with 40 ms layer 2 swings; 8 ms do, delayed at each connection."""

    def swings(run):
        force = run.signals["controller.impact_reduction_force[1]"]
        free = ~np.maximum.accumulate(run.signals["plant.contact[1]"].astype(bool))
        return int((force[free][1:] * force[free][:-1] < 0.0).sum())

    assert said("limits", r"bears steps of (\d+) ms; at (\d+) ms") == [20.0, 30.0]
    assert swings(loop["--step 0.02"]) == 0
    assert max(loop["--step 0.02"].metrics["impact_velocity"]) < 0.0065
    assert None in loop["--step 0.03"].metrics["impact_velocity"]
    assert swings(loop["--step 0.04"]) >= 3
    assert said("limits", r"and then (\d+) ms are too many") == [8.0]
    slow, fast = (loop[f"--scheme jacobi --step {h}"].metrics for h in ("8e-3", "5e-3"))
    assert max(fast["impact_velocity"]) < 0.0065 < 0.02 < min(slow["impact_velocity"])


@pytest.mark.slow
def test_your_plant(checkout, capsys):
    source = (DOCS / "spring_plant.py").read_text("utf-8")
    excerpts = 0
    for kind, block in BLOCKS.findall(page("your_plant").partition("## b.")[0]):
        if kind == "python":
            assert block in source
            excerpts += 1
        elif kind == "console":
            try_commands(block, capsys)
        else:
            assert block.startswith("[signals]")
            (checkout / "bands.toml").write_text(block, encoding="utf-8")
    assert excerpts == 2
    (lines,) = said("your_plant", r"about (\d+) lines")
    assert len(source.splitlines()) == pytest.approx(lines, abs=10)
    (cases,), _ = checked("your_plant", checkout)
    case_1 = cases["1"]
    k = int(np.flatnonzero(case_1.signals["plant.contact[2]"])[0])
    before = slice(k - 2, k)  # both free: how fast the gap closes is the impact, whoever moves
    rate = -np.diff(case_1.signals["plant.gap[2]"][before]) / np.diff(case_1.time[before])
    assert case_1.metrics["impact_velocity"][1] == pytest.approx(rate[0], rel=0.05)
    place = case_1.signals["plant.object_position"]
    assert place[k] < place[k - 1]  # finger 2 is the left one


@pytest.mark.slow
@needs_gcc
def test_an_fmu_from_elsewhere(checkout, grasp, capsys):
    """From the file of a vendor to QUALIFIED, by the page alone."""
    vendor_plant(checkout / "vendor.fmu")
    page_b = page("your_plant").partition("## b.")[2].partition("## c.")[0]
    for kind, block in BLOCKS.findall(page_b):
        if kind == "console":
            try_commands(block, capsys)
        else:
            fill_in(checkout / "my_system.toml", block)
    assert (checkout / "vendor/report.html").is_file()
    ours, theirs = simulate(grasp, step=1e-3).metrics, load_run(checkout / "vendor").metrics
    for name in ("time_to_contact", "impact_velocity", "steady_contact_force", "object_shift"):
        assert theirs[name] == pytest.approx(ours[name], rel=1e-9, abs=1e-12)


def fill_in(system, block):
    """Put each line of a table in the place of that with its key."""
    chunks = system.read_text("utf-8").split("\n\n")
    for table in block.strip().split("\n\n"):
        heading, *new = table.splitlines()
        (place,) = (i for i, chunk in enumerate(chunks) if chunk.startswith(heading))
        lines = {line.partition(" = ")[0]: line for line in chunks[place].splitlines()}
        for line in new:
            assert line.partition(" = ")[0] in lines
            lines[line.partition(" = ")[0]] = line
        chunks[place] = "\n".join(lines.values())
    system.write_text("\n\n".join(chunks), encoding="utf-8")


def try_commands(block, capsys):
    """Do the commands of a block, which print first what the page shows below them."""
    whole = block.replace("\\\n", " ")
    for part in re.findall(r"^\$ (.*?)(?=^\$ |\Z)", whole, re.MULTILINE | re.DOTALL):
        command, _, shown = part.partition("\n")
        if "CASE" in command:
            continue  # the rows of a table
        if not command.startswith("grasp-cosim "):
            subprocess.run(command, shell=True, check=True)
            continue
        capsys.readouterr()
        code = cli.main(shlex.split(command)[1:])
        assert capsys.readouterr().out.startswith(shown), command
        assert code == (1 if shown.startswith("NOT") else 0), command


def test_the_spring_plant_obeys_its_equations():
    """Against an adaptive integration, error control at the step at which a face is touched."""
    integrate = pytest.importorskip("scipy.integrate")
    plant = runpy.run_path(str(DOCS / "spring_plant.py"))
    p = plant["Params"](initial_position=(0.07, -0.11))
    u = plant["Inputs"](force=(-0.5, 0.1))

    def rates(_, y):
        x_1, x_2, x, v_1, v_2, v = y
        into_1, into_2 = x + 0.035 - x_1, x_2 - (x - 0.035)
        f_1 = max(0.0, 1e4 * into_1 + 20.0 * (v - v_1)) if into_1 > 0.0 else 0.0
        f_2 = max(0.0, 1e4 * into_2 + 20.0 * (v_2 - v)) if into_2 > 0.0 else 0.0
        spring = -100.0 * (x - 0.03) - 2.0 * v
        return [v_1, v_2, v, (-0.5 + f_1) / 0.5, (0.1 - f_2) / 0.5, (spring - f_1 + f_2) / 0.1]

    start = [0.07, -0.11, 0.03, 0.0, 0.0, 0.0]
    exact = integrate.solve_ivp(rates, (0.0, 0.3), start, max_step=1e-3, rtol=1e-9, atol=1e-12)
    errors = []
    for h in (4e-5, 2e-5):  # below its own sub-steps, so that it takes just one
        s = plant["initial_state"](p, u)
        for _ in range(round(0.3 / h)):
            s = plant["step"](p, s, u, h)
        found = [*s.position, s.object_position]
        errors.append(max(abs(a - b) for a, b in zip(found, exact.y[:3, -1], strict=True)))
    assert errors[0] < 1e-4  # m, on a way of several mm
    assert 1.5 < errors[0] / errors[1] < 2.5  # first order


def test_the_spring_plant_resolves_its_spring():
    """A damper as strong as may be, m/d = 0.1 ms: steps of 1 ms do as the exact motion does."""
    integrate = pytest.importorskip("scipy.integrate")
    plant = runpy.run_path(str(DOCS / "spring_plant.py"))
    p = plant["Params"](initial_position=(0.066, -0.11), spring_damping=1000.0)
    u = plant["Inputs"](force=(-2.0, 0.0))

    def pushed(into, rate):
        return max(0.0, 1e4 * into + 20.0 * rate) if into > 0.0 else 0.0

    def rates(_, y):
        x_1, x, v_1, v = y
        f_1 = pushed(x + 0.035 - x_1, v - v_1)
        return [v_1, v, (-2.0 + f_1) / 0.5, (-100.0 * (x - 0.03) - 1000.0 * v - f_1) / 0.1]

    times = np.arange(1, 101) * 1e-3
    exact = integrate.solve_ivp(
        rates, (0.0, 0.1), [0.066, 0.03, 0.0, 0.0], "Radau", times,
        max_step=1e-4, rtol=1e-9, atol=1e-12,
    )  # fmt: skip
    s = plant["initial_state"](p, u)
    found = []
    for _ in times:
        s = plant["step"](p, s, u, 1e-3)
        found.append((s.contact_force[0], s.position[0], s.object_position))
    force, *places = np.transpose(found)
    x_1, x, v_1, v = exact.y
    expected = [pushed(*y) for y in zip(x + 0.035 - x_1, v - v_1, strict=True)]
    assert max(expected) > 5.0  # N
    assert np.abs(force - expected).max() < 0.1
    assert np.abs(places - exact.y[:2]).max() < 1e-5


def test_the_spring_plant_at_rest():
    """A finger that pushes alone moves the object until the spring answers: x - x_0 = F/k."""
    plant = runpy.run_path(str(DOCS / "spring_plant.py"))
    p = plant["Params"](initial_position=(0.066, -0.11), spring_damping=20.0)
    u = plant["Inputs"](force=(-0.5, 0.0))
    s = plant["initial_state"](p, u)
    for _ in range(3000):
        s = plant["step"](p, s, u, 1e-3)
    y = plant["outputs"](p, s, u)
    assert y.object_position == pytest.approx(0.03 - 0.5 / 100.0, abs=1e-9)
    assert y.contact_force == pytest.approx((0.5, 0.0), abs=1e-6)
    assert y.spring_force == pytest.approx(0.5, abs=1e-6)
    assert y.contact == (True, False)
