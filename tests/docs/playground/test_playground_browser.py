"""The playground under a hand: sliders, choices, grasps to choose, keys, address, size."""

import json
import re
from urllib.parse import unquote

import pytest
from playground.page import page_system, playground_html
from playground.wasm import PLANTS
from report.javascript import in_browser

pytestmark = pytest.mark.slow

HANDS = """
const settle = frame;
const move = async (id, value, type = "input") => {
  find(id).value = value;
  find(id).dispatchEvent(new Event(type, { bubbles: true }));
  await settle();
};
const click = async (element) => { element.click(); await settle(); };
const press = async (key, more = {}) => {
  (more.on || document.body).dispatchEvent(
    new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true, ...more }));
  await settle();
};
"""


@pytest.fixture(scope="module")
def html():
    return playground_html()


def act(html, body, folder, *rest, **more):
    return in_browser(html, HANDS + body, folder, *rest, **more)


@pytest.mark.parametrize("plant", PLANTS)
def test_each_slider_and_its_number_run_the_grasp_anew(html, tmp_path, plant):
    """Dragged, or by arrow keys, which give a range its value as well; or typed."""
    body = """
      const seen = {};
      for (const { row, range, number, name, low, high, step } of CONTROLS) {
        location.hash = start;
        await frame();
        if (row.hidden) continue;
        const before = state.metrics, value = digits(Number(range.value) - 2 * step);
        range.value = value >= low ? value : digits(value + 4 * step);
        range.dispatchEvent(new Event("input", { bubbles: true }));
        await frame();
        const dragged = [range.value, number.value, command(), address(), state.metrics !== before];
        await move(`${name}-number`, digits(low + 0.4 * (high - low)), "change");
        seen[name] = [dragged, [range.value, number.value, command()]];
      }
      return seen;
    """
    start = f"plant={plant}&case=1&step=0.002&stop=4&at=0"
    seen = act(html, f"const start = {start!r};{body}", tmp_path)
    controls = {
        c["name"]: c
        for group in page_system()["groups"]
        for c in group["controls"]
        if _is_of(plant, c)
    }
    assert set(seen) == set(controls)
    # Case 1 is without layer 3; a limit and a height matter where they are exceeded, or it tips.
    idle = {"Ks", "Ka2", "Da2", "Ma2", "limit", "height"}
    for name, ((place, number, command, address, differs), typed) in seen.items():
        control = controls[name]
        value = float(number) / control["per"]
        setting = f"{control['variables'][0]}={value:.12g}"
        assert place == number
        assert setting in command.replace('"', "")
        assert setting in unquote(address)
        assert differs or name in idle, name
        middle = control["low"] + 0.4 * (control["high"] - control["low"])
        assert float(typed[1]) == pytest.approx(middle)
        assert float(typed[0]) == pytest.approx(middle, abs=control["step"])
        assert f"{control['variables'][0]}=" in typed[2]


def _is_of(plant, control):
    """True if the slider is there with a plant."""
    system = page_system()
    models = {**system["components"], "plant": PLANTS[plant]}
    component, _, variable = control["variables"][0].partition(".")
    names = (name for name, *_ in system["models"][models[component]])
    return variable in names and plant in control.get("plants", [plant])


def test_choices_and_switches(html, tmp_path):
    body = """
      const seen = [];
      for (const [id, value] of [["case", 0], ["case", 1], ["case", 2], ["controller", "adaptive"],
        ["plant", "soft"], ["plant", "movable"], ["plant", "fixed"], ["controller", "published"]]) {
        await click(document.querySelector(`#${id} input[value="${value}"]`));
        seen.push(command());
      }
      await click(find("jacobi"));
      await click(find("bench"));
      await move("step", "0.005", "change");
      await move("stop", "2");
      seen.push(command(), address());
      await move("name", "sensor_1.gain");
      await move("value", "0.002");
      await click(find("set"));
      seen.push(find("chips").textContent, find("unit").textContent, find("meaning").textContent);
      await click(find("chips").querySelector("button"));
      seen.push(find("chips").textContent);
      await move("value", "much");
      await click(find("set"));
      seen.push(find("message").textContent);
      return seen;
    """
    seen = act(html, body, tmp_path, "at=0")
    swap = "grasp-cosim run --swap plant=fmus/build/"
    assert seen[:8] == [
        "grasp-cosim run --case 0",
        "grasp-cosim run --case 1",
        "grasp-cosim run",
        "grasp-cosim run --controller adaptive",
        f"{swap}GripperPlantCompliant.fmu --controller adaptive",
        f"{swap}GripperPlantMovable.fmu --controller adaptive",
        "grasp-cosim run --controller adaptive",
        "grasp-cosim run",
    ]
    assert seen[8] == "grasp-cosim run --preset bench --step 0.005 --stop 2 --scheme jacobi"
    assert seen[9] == "bench=1&step=0.005&stop=2&scheme=jacobi"
    assert seen[10].startswith("sensor_1.gain = 0.002 V·mⁿ")
    assert seen[11:14] == ["V.m^n", seen[12], ""]
    assert seen[12].startswith("K = ")
    assert seen[14] == "sensor_1.gain: much: no value for it"


def test_each_grasp_of_the_documentation_can_be_chosen(html, tmp_path):
    """From the list, and one after the other; it is there again from its address."""
    body = """
      const chosen = [], seen = [];
      for (let i = 0; i < system.presets.length; i++) {
        find("preset").value = i;
        find("preset").dispatchEvent(new Event("change"));
        play(false);
        chosen.push([find("about").textContent, address(), state.metrics]);
      }
      for (const [about, there, metrics] of chosen) {
        location.hash = `${there}&at=0`;
        await settle();
        seen.push([about, find("message").textContent, find("preset").value,
          state.metrics === metrics]);
      }
      await click(find("next"));
      play(false);
      seen.push(find("preset").value);
      await click(find("previous"));
      seen.push(find("preset").value);
      return seen;
    """
    *seen, after_last, back = act(html, body, tmp_path, "at=0")
    presets = page_system()["presets"]
    assert seen == [
        [f"{preset['text']} ({preset['page']})", "", str(i), True]
        for i, preset in enumerate(presets)
    ]
    assert (after_last, back) == ("0", str(len(presets) - 1))


def test_keys(html, tmp_path):
    body = """
      const seen = [], note = () => seen.push([cursor, view.from, view.to, playing,
        find("preset").value]);
      note();
      await press("ArrowRight"); note();
      await press("ArrowLeft", { shiftKey: true }); note();
      await press("+"); note();
      await press("-"); note();
      await press("+"); await press("0"); note();
      await press("]"); play(false); note();
      await press("["); await press("["); play(false); note();
      await press(" "); note();
      await press(" ", { on: find("position") }); note();
      await press("]", { on: find("position-number") }); note();
      return seen;
    """
    seen = act(html, body, tmp_path, "step=0.01&at=1.5")
    times = [row[0] for row in seen[:6]]
    assert times == pytest.approx([1.5, 1.53, 1.52, 1.52, 1.52, 1.52])
    assert [row[1:3] for row in seen[2:6]] == [
        [0, 3], [pytest.approx(0.77), pytest.approx(2.27)], [0, 3], [0, 3],
    ]  # fmt: skip
    last = len(page_system()["presets"]) - 1
    assert [row[4] for row in seen[5:8]] == ["", "1", str(last)]
    assert [row[3] for row in seen[7:]] == [False, True, False, False]
    assert seen[10][4] == str(last)  # in a field the key is the field's


def test_the_address_keeps_all_and_mistakes_in_it_are_said(html, tmp_path):
    body = """
      const seen = [location.hash, cursor, view.from, view.to, find("left").value, command()];
      await new Promise((done) => setTimeout(done, 500));
      seen.push(location.hash);
      location.hash = "plant=glass&case=7&step=x&sensor_1.gain=&sensor_3.gain=1"
        + "&sensor_2.gain=0.002";
      await settle();
      seen.push(find("message").textContent, command());
      return seen;
    """
    address = "case=1&step=0.001&sensor_2.reflectance=0.5&plant.friction.coulomb%5B1%5D=0.2"
    seen = act(html, body, tmp_path, f"{address}&t=1,2&at=1.25")
    assert seen[1:5] == [1.25, 1, 2, "0.5"]
    assert seen[5] == (
        "grasp-cosim run --case 1 --step 0.001 --set sensor_2.reflectance=0.5 "
        '--set "plant.friction.coulomb[1]=0.2"'
    )
    assert seen[6] == f"#{address}&t=1,2&at=1.25"
    assert seen[7].split("; ") == [
        "plant=glass: must be one of fixed, soft, movable",
        "case=7: must be one of 0, 1, 2",
        "step=x: must be from 0.000001 to 1 s",
        "sensor_1.gain=: no such parameter, or no value for it",
        "sensor_3.gain=1: no such parameter, or no value for it",
    ]
    assert seen[8] == "grasp-cosim run --set sensor_2.gain=0.002"


def test_what_an_fmu_refuses_is_said_and_mended(html, tmp_path):
    body = """
      await move("width", 140);
      await move("position", 70);
      const seen = [find("message").textContent, document.body.className,
        find("summary").textContent];
      await move("position", 0);
      return [...seen, find("message").textContent, document.body.className];
    """
    said, dimmed, *rest = act(html, body, tmp_path, "step=0.002&at=1")
    assert said.startswith("plant, t = 0 s: object_width = 0.14 m at initial_object_position")
    assert dimmed == "stale"
    assert rest == ["", "", ""]


def test_the_hand_moves_and_the_fingers_differ_without_colour(html, tmp_path):
    body = """
      const seen = [], hand = find("fingers").dataset;
      for (const t of [0, 0.5, 3]) {
        seek(t);
        await settle();
        seen.push([hand.finger1, hand.finger2].map(Number));
      }
      const lines = [...document.querySelectorAll("#plots .panel")].map((panel) => [
        panel.querySelector("h3").textContent,
        ...[...panel.querySelectorAll("li")].map((line) => line.dataset.dash)]);
      seek(0);
      play(true);
      const times = [];
      while (playing) { await new Promise(requestAnimationFrame); times.push(cursor); }
      return { seen, lines, times };
    """
    found = act(html, body, tmp_path, "at=0&step=0.002&controller=adaptive")
    (start, *_, end) = found["seen"]
    assert start == [0.11, -0.11]
    assert end == pytest.approx([0.065, -0.005], abs=1e-4)
    assert found["lines"] == [
        ["gap in mm", "0", "1"],
        ["contact force in N", "0", "1"],
        ["target in mm", "0", "2"],
        ["closing speed in mm/s", "0", "1"],
        ["ratio of the reflectances, learnt", "0"],
    ]
    assert found["times"] == sorted(found["times"])
    assert found["times"][-1] == 3.0
    assert len(found["times"]) > 100


def test_the_object_can_be_dragged(html, tmp_path):
    body = """
      const canvas = find("fingers"), seen = [];
      canvas.setPointerCapture = () => {};
      const send = (type, x, more) => canvas.dispatchEvent(new PointerEvent(type,
        { clientX: 300 + x * canvas.dataset.scale / 1000, button: 0, bubbles: true, ...more }));
      send("pointerdown", 0, { button: 2 });
      send("pointermove", 5);
      send("pointerdown", 0);
      for (const x of [-20.3, -49.8, 900]) {
        send("pointermove", x);
        await frame();
        seen.push(find("position-number").value);
      }
      send("pointerup", 900);
      send("pointermove", 0);
      await frame();
      return [...seen, find("position-number").value, command()];
    """
    command = "grasp-cosim run --step 0.002 --set plant.initial_object_position=0.07"
    assert act(html, body, tmp_path, "at=0&step=0.002") == ["10", "-20", "70", "70", command]


def test_buttons_and_time(html, tmp_path):
    """Reset, the links to copy, the time and the speed of the hand."""
    body = """
      const seen = [], copied = [];
      Object.defineProperty(navigator, "clipboard", { configurable: true,
        value: { writeText: async (text) => { copied.push(text); } } });
      await move("position", 12);
      await click(find("copy"));
      await click(find("link"));
      seen.push(find("copy").textContent, find("link").textContent, copied.map(
        (text) => text.split("#").at(-1)));
      navigator.clipboard.writeText = async () => { throw new Error("no"); };
      await click(find("copy"));
      seen.push(find("copy").textContent);
      await click(find("reset"));
      play(false);
      seen.push(command(), find("position").value);
      await move("scrub", 1.25);
      seen.push(cursor, find("clock").textContent, find("pace").textContent);
      await move("speed", 0, "change");
      seen.push(find("pace").textContent);
      await click(find("play"));
      seen.push(playing, find("play").textContent);
      await click(find("play"));
      seen.push(playing, cursor > 1.25);
      return seen;
    """
    run = "grasp-cosim run --step 0.002 --set plant.initial_object_position=0.012"
    link = "step=0.002&plant.initial_object_position=0.012&at=1"
    copied, linked, texts, refused, *rest = act(html, body, tmp_path, "at=1&step=0.002")
    assert (copied, linked, texts) == ("Copied", "Copied", [run, link])
    assert refused == "The browser does not allow it"
    assert rest[:2] == ["grasp-cosim run", "30"]
    assert rest[2:6] == [1.25, "1.250 s", "", "1 × real time"]
    assert rest[6:] == [True, "Pause", False, True]


def luminance(color):
    """The relative luminance of a color like rgb(1, 2, 3), as WCAG 2.2 has it."""
    shares = [int(part) / 255.0 for part in re.findall(r"\d+", color)[:3]]
    r, g, b = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(one, other):
    darker, lighter = sorted((luminance(one), luminance(other)))
    return (lighter + 0.05) / (darker + 0.05)


@pytest.mark.parametrize("dark", [False, True])
def test_all_that_is_written_and_the_fingers_are_told_from_the_ground(html, tmp_path, dark):
    """4.5 to 1 for text, 3 to 1 for what is drawn: WCAG 2.2, AA."""
    body = """
      for (const details of document.querySelectorAll("details")) details.open = true;
      const clear = "rgba(0, 0, 0, 0)", seen = {};
      const ground = (e) => {
        const own = e ? getComputedStyle(e).backgroundColor : "rgb(255, 255, 255)";
        return own === clear ? ground(e.parentElement) : own;
      };
      for (const e of document.querySelectorAll("body *")) {
        const written = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!e.offsetParent || !(written || e.matches("input[type=number], #name"))) continue;
        seen[`${getComputedStyle(e).color} on ${ground(e)}`] = e.outerHTML.slice(0, 80);
      }
      const probe = document.createElement("i");
      document.body.append(probe);
      const drawn = ["--finger1", "--finger2", "--ink", "--muted"].map((name) => {
        probe.style.color = `var(${name})`;
        return getComputedStyle(probe).color;
      });
      return [seen, drawn, getComputedStyle(document.body).backgroundColor];
    """
    texts, drawn, paper = act(html, body, tmp_path, "at=1&step=0.002", dark=dark)
    assert (luminance(paper) < 0.1) is dark
    faint = {pair: of for pair, of in texts.items() if contrast(*pair.split(" on ")) < 4.5}
    assert len(texts) > 4
    assert faint == {}
    assert min(contrast(color, paper) for color in drawn) >= 3.0


@pytest.mark.parametrize("still", [False, True])
def test_it_begins_to_move_unless_the_user_wants_no_motion(html, tmp_path, still):
    playing, cursor = act(html, "return [playing, cursor];", tmp_path, "step=0.002", still=still)
    assert playing is not still
    assert (cursor == 3.0) is still


FRAMED = """
<html data-ready="yes"><head></head><body style="margin: 0"><script>const recording = {};</script>
<iframe style="border: 0"></iframe></body></html>
"""
"""For a page in a frame of any width; a window of Chromium has 500 px at least."""


@pytest.mark.parametrize("width", [360, 768, 1280, 1900])
def test_nothing_is_wider_than_the_window_or_without_a_name(html, tmp_path, width):
    text = json.dumps(html).replace("</", "<\\/")
    body = f"""
      const inner = document.querySelector("iframe");
      inner.width = {width};
      inner.height = 900;
      inner.srcdoc = {text};
      let page = null;
      while (!page?.documentElement.dataset.ready) {{
        await sleep(1);
        work();
        page = inner.contentDocument;
      }}
      for (const details of page.querySelectorAll("details")) details.open = true;
      const unnamed = [...page.querySelectorAll("button, input, select, canvas")].filter(
        (e) => !(e.labels?.length || e.ariaLabel || e.title || e.textContent.trim()));
      const small = [...page.querySelectorAll(".control input[type=range], .pick span")]
        .filter((e) => e.offsetParent && e.getBoundingClientRect().height < 22);
      return [inner.contentWindow.innerWidth, page.documentElement.scrollWidth,
        unnamed.map((e) => e.outerHTML), small.map((e) => e.outerHTML)];
    """
    assert in_browser(FRAMED, body, tmp_path) == [width, width, [], []]
