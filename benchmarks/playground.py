"""How soon the playground shows a grasp again after a slider has moved, in headless Chromium.

    python -m benchmarks.playground

From the event of the slider until the frame in which all is drawn, by the clock on the wall; 3 s of
a grasp, 40 moves of the object. `simulated` is the part of it in WebAssembly.
"""

import json
import shutil
import subprocess
import sys
import tempfile
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

from grasp_cosim.grasp.play.page import playground_html

from benchmarks.harness import head, row, spread

MOVES = 40
SETTINGS = {
    f"{plant}, {law}, {label}": f"plant={plant}&controller={law}&step={step}"
    for label, step in {"0.1 ms": 1e-4, "1 ms": 1e-3}.items()
    for plant in ("fixed", "soft", "movable")
    for law in ("published", "adaptive")
}

MEASURE = """
<script>
(async () => {
  while (!document.documentElement.dataset.ready) await new Promise((done) => setTimeout(done, 20));
  play(false);
  const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  const found = {};
  for (const [name, address] of Object.entries(SETTINGS)) {
    location.hash = `${address}&at=1`;
    await new Promise((done) => setTimeout(done, 300));
    found[name] = { shown: [], simulated: [] };
    for (let i = 0; i < MOVES; i++) {
      const began = performance.now();
      find("position").value = 10 + i;
      find("position").dispatchEvent(new Event("input", { bubbles: true }));
      while (asked || due) await frame();
      found[name].shown.push(performance.now() - began);
      found[name].simulated.push(Number(find("took").textContent.match(/(\\d+) ms$/)[1]));
      await frame();
    }
  }
  await fetch("ADDRESS", { method: "POST", mode: "no-cors", body: JSON.stringify(found) });
})();
</script>
</body>"""


def measured(width: int) -> dict[str, dict[str, list[float]]]:
    """What the page measures of itself in a window so wide."""
    answers: list[dict[str, Any]] = []

    class Receiver(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            answers.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Receiver)
    script = MEASURE.replace("ADDRESS", f"http://127.0.0.1:{server.server_port}/")
    script = script.replace("MOVES", str(MOVES)).replace("SETTINGS", json.dumps(SETTINGS))
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = Path(folder, "play.html")
        page.write_text(playground_html().replace("</body>", script), "utf-8")
        waiter = threading.Thread(target=server.handle_request)
        server.timeout = 300
        waiter.start()
        browser = subprocess.Popen(
            [shutil.which("chromium") or "chromium-browser", "--headless", "--no-sandbox",
             "--disable-gpu", f"--window-size={width},1000", "--remote-debugging-port=0",
             f"--user-data-dir={folder}/profile", page.as_uri()],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            waiter.join()
        finally:
            browser.terminate()
            browser.wait()
            server.server_close()
    if not answers:
        sys.exit("no answer within 300 s")
    return answers[0]


def main() -> None:
    """Print a table for a phone and for a wide screen."""
    for width in (500, 1900):
        print(f"\n{width} px wide: least / median / largest")
        head("plant, controller, step", "shown, ms", "of it simulated, ms")
        for name, times in measured(width).items():
            cells = (" / ".join(f"{v:.0f}" for v in spread(times[of])) for of in times)
            row(name, *cells)


if __name__ == "__main__":
    main()
