"""Makes the site of all pages and of the Python interface, by MkDocs: make docs.

    .venv/bin/python docs/website.py [FOLDER]     # by default results/site; begin with index.html

Pages stay where they belong in the checkout; they are copied beside what they link to. Any warning
is an error: a link that leads nowhere, a name without a docstring.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from latex2mathml.converter import convert

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"\]\(([^)#\s:]+)(?:#[^)]*)?\)")
MATH = re.compile(r"^```math\n(.*?)^```$", re.DOTALL | re.MULTILINE)

API = (
    "grasp_cosim",
    "grasp_cosim.master.simulation",
    "grasp_cosim.metrics.metric",
    "grasp_cosim.exchange.listener",
    "grasp_cosim.recording.csv",
    "grasp_cosim.recording.mdf",
    "grasp_cosim.sweeps.sweep",
    "grasp_cosim.gym.environment",
    "grasp_cosim.linearisation.state_space",
    "grasp_cosim.comparison.compare",
    "grasp_cosim.comparison.qualify",
    "grasp_cosim.comparison.bands",
)
"""What users import; the names of `grasp_cosim` itself are all that most need."""

ROOTS = ("plant", "sensor", "controller", "fmus", "orchestrator")


def pages() -> list[Path]:
    """All pages that one comes to from the README, from the top of the checkout."""
    found = [Path("README.md")]
    for page in found:
        for link in LINK.findall((ROOT / page).read_text("utf-8")):
            target = (ROOT / page.parent / link).resolve().relative_to(ROOT)
            if target.suffix == ".md" and target not in found:
                found.append(target)
    return found


def copy(folder: Path) -> None:
    """Put the pages and what they link to into a folder, equations as MathML."""
    for page in pages():
        text = (ROOT / page).read_text("utf-8")
        for link in LINK.findall(text):
            if (source := ROOT / page.parent / link).is_file() and source.suffix != ".md":
                target = folder / source.resolve().relative_to(ROOT)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(source, target)
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(
            MATH.sub(lambda m: convert(m[1], display="block"), text), "utf-8"
        )
    for name in API:
        path = folder / "api" / f"{name}.md"
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"# {name}\n\n::: {name}\n", "utf-8")


def navigation() -> list[Any]:
    """The pages in groups, in the order in which one comes to them."""
    names = [page.as_posix() for page in pages()]
    cards = [name for name in names if name.partition("/")[0] in ROOTS[:3]]
    docs = [name for name in names if name.startswith("docs/")]
    rest = [name for name in names if name not in (names[0], *cards, *docs)]
    api = [f"api/{name}.md" for name in API]
    groups = {"Pages": docs, "Equations": cards, "Inside": rest, "Python": api}
    return [{"grasp-cosim": names[0]}, *({title: group} for title, group in groups.items())]


def config(source: Path, site: Path) -> str:
    """What MkDocs is to do, as JSON, which is YAML, too."""
    python = {
        "paths": [str(ROOT / root) for root in ROOTS],
        "options": {"show_root_heading": False, "show_source": False, "members_order": "source"},
    }
    return json.dumps(
        {
            "site_name": "grasp-cosim",
            "docs_dir": str(source),
            "site_dir": str(site),
            "use_directory_urls": False,
            "nav": navigation(),
            "theme": {"name": "material", "font": False},
            "plugins": ["search", {"mkdocstrings": {"handlers": {"python": python}}}],
            "markdown_extensions": ["tables", "fenced_code", "md_in_html"],
            "validation": {"anchors": "warn", "unrecognized_links": "warn"},
        }
    )


def main(site: Path) -> None:
    """Write the site; SystemExit with MkDocs' exit code where there is a warning."""
    with TemporaryDirectory(prefix="grasp_site_") as name:
        source = Path(name, "pages")
        copy(source)
        (settings := Path(name, "mkdocs.yml")).write_text(config(source, site.resolve()), "utf-8")
        command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", str(settings)]
        env = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        done = subprocess.run(command, env=env, capture_output=True, text=True)  # noqa: S603
        if done.returncode:
            raise SystemExit(done.stderr)
    print(site / "index.html")


if __name__ == "__main__":
    main(Path(*sys.argv[1:]) if sys.argv[1:] else ROOT / "results/site")
