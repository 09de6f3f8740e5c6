"""The scripts of the page, run in Node and a headless Chromium; skips where these are missing."""

import json
import re
import shutil
import subprocess
from html import escape, unescape
from importlib.resources import files

import pytest

WAIT = 30
"""s of the page's own clock, which Chromium runs as fast as it can."""

_FRAMES = """<head><script>
window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 16);
</script>"""
"""Frames by the page's own clock; those of the screen come by the clock on the wall."""

_ACT = """
<script>
(async () => {
  const root = document.documentElement.dataset;
  const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
  const work = () => { let x = 0; for (let i = 0; i < 1e7; i++) x += i; return x; };
  const frame = async () => {
    await Promise.all([...(recording.loaded?.values() ?? [])]);
    await new Promise(requestAnimationFrame);
    await sleep(50);
  };
  while (!root.ready && !root.error) { // the page's clock runs while it unpacks elsewhere: keep up
    work();
    await sleep(1);
  }
  if (root.error) return;
  await frame();
  const result = await (async () => { %s })();
  root.result = JSON.stringify(result === undefined ? null : result);
})();
</script>
</body>"""


_PHONE = """<!DOCTYPE html><html lang="en"><body style="margin: 0"><iframe
style="width: %dpx; height: %dpx; border: 0" srcdoc="%s"></iframe><script>
const inner = document.querySelector("iframe").contentWindow;
const state = document.documentElement.dataset;
const look = () => {
  const { error, result } = inner.document.documentElement?.dataset ?? {};
  if (error) state.error = error;
  else if (result) state.result = result;
  else setTimeout(look, 20);
};
look();
</script></body></html>"""
"""A window narrower than NARROWEST: the page in a frame, where it has no address to keep."""

NARROWEST = 500
"""px; Chromium makes no window that is narrower."""

_NO_ADDRESS = "<head><script>history.replaceState = () => {};</script>"


def run_node(scripts, body, given, folder):
    """What the body passes to output(), run after scripts of the page with `input` given."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    page = files("grasp_cosim.report") / "page"
    lines = [(page / name).read_text("utf-8") for name in scripts]
    lines += [
        'const input = JSON.parse(require("fs").readFileSync(0, "utf8"));',
        "const output = (value) => process.stdout.write(JSON.stringify(value));",
        body,
    ]
    file = folder / "script.js"
    file.write_text("\n".join(lines), "utf-8")
    done = subprocess.run(
        [node, str(file)], input=json.dumps(given), capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def in_browser(html, act, folder, address="", size=(1200, 1600), dark=False, still=False):
    """What the function body act returns in the page, once it is ready; fails on any error in it.

    address is what follows the # in the address; still says that its user wants no motion.
    """
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("chromium is not installed")
    file = folder / "acted.html"
    assert html.count("<head>") == html.count("</body>") == 1
    acted = html.replace("<head>", _FRAMES).replace("</body>", _ACT % act)
    if size[0] < NARROWEST:
        acted = _PHONE % (*size, escape(acted.replace("<head>", _NO_ADDRESS, 1)))
    file.write_text(acted, "utf-8")
    done = subprocess.run(
        [
            chromium, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
            "--disable-background-networking", f"--user-data-dir={folder / 'profile'}",
            f"--window-size={size[0]},{size[1]}", f"--virtual-time-budget={1000 * WAIT}",
            *(["--blink-settings=preferredColorScheme=0"] if dark else []),
            *(["--force-prefers-reduced-motion"] if still else []),
            "--dump-dom", f"{file.as_uri()}#{address}",
        ],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    root = re.search(r"<html[^>]*>", done.stdout)
    assert root, done.stderr
    error = re.search(r'data-error="([^"]*)"', root[0])
    assert error is None, unescape(error[1] if error else "")
    result = re.search(r'data-result="([^"]*)"', root[0])
    assert result, f"no result within {WAIT} s: {root[0]}"
    return json.loads(unescape(result[1]))
