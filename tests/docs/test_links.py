"""Every link of a page to another file, or to a heading, leads there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/*.md", "*/README.md", "*/*/*/README.md", "*/*/README.md")
    for page in ROOT.glob(pattern)
    if not page.relative_to(ROOT).parts[0].startswith(".")
)


def headings(page):
    """The anchors that GitHub gives the headings of a page."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    found = (re.sub(r"[`*]", "", line).lower() for line in re.findall(r"^#+ (.*)$", text, re.M))
    return {re.sub(r"[^\w\- ]", "", line).replace(" ", "-") for line in found}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    broken = []
    for link, heading in re.findall(r"\]\(([^)#\s]*)(?:#([^)]*))?\)", page.read_text("utf-8")):
        if link.startswith("http"):
            continue
        target = page.parent / link if link else page
        there = target.suffix != ".md" or not heading or heading in headings(target)
        if not (target.exists() and there):
            broken.append(f"{link}#{heading}")
    assert broken == []


def test_there_are_pages_with_links():
    names = {page.relative_to(ROOT).as_posix() for page in PAGES}
    assert {"README.md", "docs/guide.md", "docs/glossary.md", "plant/README.md"} <= names


def test_each_word_is_in_the_glossary_once():
    glossary = (ROOT / "docs/glossary.md").read_text("utf-8")
    rows = [row.split(" | ")[0] for row in re.findall(r"^\| (.*)", glossary, re.M)]
    words = [word for row in rows if row != "word" for word in row.split(", ")]
    assert len(set(words)) == len(words)
    asked = {"O-RLI", "case", "layer", "bench", "proxy", "Jacobi", "SSP", "sequential", "role"}
    assert asked | {"preset", "native twin", "contact"} <= set(words)
