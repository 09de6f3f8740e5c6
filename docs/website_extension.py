"""An extension of Sphinx for docs/website.py: equations as MathML, links to the glossary."""

import re
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import click
from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.fileutil import copy_asset
from sphinx.writers.html5 import HTML5Translator

GLOSSARY = "docs/reference/glossary"
GENERATED = re.compile("docs/reference/(commands|python)/")

NOT_IN = (nodes.reference, nodes.literal, nodes.title, nodes.raw, nodes.literal_block, nodes.term)
"""Kinds of text in which no word becomes a link."""


TAG = re.compile(r"\s*\\tag\{(.*?)\}")


def symbols(translator: HTML5Translator, node: nodes.math) -> None:
    """Write the symbols in a line as MathML, which browsers set with the font of website.css."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def equation(translator: HTML5Translator, node: nodes.math_block) -> None:
    """Write an equation as MathML, with its number at the right margin."""
    text = node.astext()
    tag = TAG.search(text)
    mathml = convert(TAG.sub("", text), display="block")
    number = f'<span class="number">({tag[1]})</span>' if tag else ""
    translator.body.append(f'<div class="equation">{mathml}{number}</div>\n')
    raise nodes.SkipNode


def show_examples(_: Sphinx, __: click.Context, lines: list[str]) -> None:
    """Make blocks of code of the commands in the help of a command.

    A paragraph of the help that click does not wrap begins with a backspace.
    """
    shown: list[str] = []
    for line in lines:
        words = line.replace("\b", "").lstrip("| ")
        text, command, rest = words.partition("grasp-cosim ")
        if not line.startswith(("\b", "| ")) or not command:
            shown.append(words if line.startswith("| ") else line)
            continue
        shown += [text.strip() or "Example:", "", ".. code-block:: bash", ""]
        shown += [f"   {command}{rest}", ""]
    lines[:] = shown


def copy_font(app: Sphinx, error: Exception | None) -> None:
    """Put STIX Two Math into the site; the package ziamath has it."""
    if error is None:
        font = files("ziamath") / "fonts/STIXTwoMath-Regular.ttf"
        copy_asset(str(font), app.outdir / "_static")


# Links to the glossary


def words_of(glossary: nodes.document) -> dict[str, str]:
    """The words that the glossary explains, with the anchors of their rows, which this sets.

    The code has words with a meaning among its authors: that section is left out.
    """
    anchors: dict[str, str] = {}
    of_code = {
        id(row)
        for section in glossary.findall(nodes.section)
        if "the-code" in section["ids"]
        for row in section.findall(nodes.row)
    }
    for row in glossary.findall(nodes.row):
        if isinstance(row.parent, nodes.thead) or id(row) in of_code:
            continue
        cell: Any = next(row.findall(nodes.entry))
        words = [word.strip() for word in cell.astext().split(",")]
        anchor = f"word-{nodes.make_id(words[0])}"
        cell.children[0]["ids"].append(anchor)
        anchors |= dict.fromkeys(words, anchor)
    return anchors


class Vocabulary(NamedTuple):
    """The words of the glossary: their pattern, and the anchors of their rows in lower case."""

    pattern: re.Pattern[str]
    anchors: dict[str, str]


@cache
def vocabulary(app: Sphinx) -> Vocabulary:
    """The words of the glossary of a site; the longest of several words is found first."""
    anchors = words_of(app.env.get_doctree(GLOSSARY))
    words = "|".join(map(re.escape, sorted(anchors, key=len, reverse=True)))
    pattern = re.compile(rf"(?<![\w-])({words})(?=s?(?![\w-]))", re.I)
    return Vocabulary(pattern, {word.lower(): anchor for word, anchor in anchors.items()})


def link_words(app: Sphinx, document: nodes.document, name: str) -> None:
    """Make the first use of each word of the glossary on a page a link to it."""
    if name == GLOSSARY:
        words_of(document)
    if name == GLOSSARY or not name.startswith("docs/") or GENERATED.match(name):
        return
    address = app.builder.get_relative_uri(name, GLOSSARY)
    linked: set[str] = set()
    for text in list(texts(document)):
        parts = linked_parts(text, vocabulary(app), address, linked)
        if len(parts) > 1 and text.parent is not None:
            text.parent.replace(text, parts)


def linked_parts(
    text: nodes.Text, words: Vocabulary, address: str, linked: set[str]
) -> list[nodes.Node]:
    """The parts of a text, of which words that are not yet linked are links; adds their anchors."""
    parts: list[nodes.Node] = []
    end = 0
    for match in words.pattern.finditer(text):
        anchor = words.anchors[match[0].lower()]
        if anchor in linked:
            continue
        linked.add(anchor)
        uri = f"{address}#{anchor}"
        link = nodes.reference(match[0], match[0], refuri=uri, internal=True, classes=["word"])
        parts += [nodes.Text(text[end : match.start()]), link]
        end = match.end()
    return [*parts, nodes.Text(text[end:])]


def texts(document: nodes.document) -> Iterator[nodes.Text]:
    """The texts of a page in which a word may become a link."""
    for text in document.findall(nodes.Text):
        parent: Any = text.parent
        while parent is not None and not isinstance(parent, NOT_IN):
            parent = parent.parent
        if parent is None:
            yield text


def setup(app: Sphinx) -> dict[str, bool]:
    """Register all of it; called by Sphinx."""
    app.add_html_math_renderer(
        "mathml",
        (symbols, None),
        (equation, None),
    )
    app.connect("build-finished", copy_font)
    app.connect("sphinx-click-process-description", show_examples)
    app.connect("doctree-resolved", link_words)
    return {"parallel_read_safe": True}
