"""Makes what an FMU holds for its reader: documentation/index.html, the licences, the icon."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import cycle
from pathlib import Path
from re import MULTILINE, search, sub
from string import Template
from typing import Any, NamedTuple

from .cards import BEGIN

ICONS = Path(__file__).parent / "icons"
FRAME = Path(__file__).with_name("page.html.in")
PYTHON = Path(__file__).with_name("python.html.in")
"""The page, and what it says of an FMU that runs in Python."""

OURS = {"license.txt": "grasp-cosim"}
_LICENCES = {**OURS, "pythonfmu.txt": "pythonfmu"}
"""The distribution whose licence is in each file of documentation/licenses."""

_ANY = """A libpython in the process: start the host with
<code>LD_PRELOAD=libpython3.x.so.1.0</code>, say <code>libpython3.11.so.1.0</code>, or use an FMU
built with <code>grasp-cosim $command --bind-python</code>. Python's standard library is found
through <code>PYTHONHOME</code>, or through <code>python3</code> on the <code>PATH</code>."""
_BOUND = """Nothing where there is <code>$library</code>, to which this FMU is bound: it brings it
along, and knows where its standard library is. On another machine build it there."""
"""The needs of a host on Linux, for an FMU bound to a libpython and for any other."""

_NATIVE = "The native FMU of it, from <code>grasp-cosim $command --native</code>, needs no Python."


class Making(NamedTuple):
    """How an FMU was made: the command, and what to say of its steps and states, as HTML."""

    command: str
    steps: str
    states: str


BLOCK = Making(
    "build",
    "A step whose results would not be finite returns <code>fmi2Discard</code>.",
    """Getting, setting, freeing and serialising the state of the FMU are supported. A state can be
exchanged between instances of the same FMU. The bytes of a serialised state are guarded by a check
sum.""",
)
PROXY = Making(
    "proxy",
    """A step without an answer in time returns <code>fmi2OK</code>: <code>proxy.state</code> says
what became of it, and the log that the peer is lost. With <code>proxy.on_loss = stop</code> the
step in which it is lost returns <code>fmi2Error</code>, and so does every later one.""",
    "Not supported: the state is that of the peer.",
)


def page(
    name: str,
    summary: str,
    card: str,
    version: str,
    library: Path | None = None,
    making: Making = BLOCK,
    requires: Sequence[str] = (),
) -> str:
    """Return documentation/index.html of the FMU `name`, from its card in Markdown.

    `library` is the libpython to which the FMU is bound, if it is; `requires` are the extras of
    grasp-cosim, each called as its package, that it needs in the host's Python.
    """
    sections = Template(PYTHON.read_text("utf-8")).substitute(
        name=escape(name),
        linux=Template(_BOUND if library else _ANY).substitute(
            library=escape(str(library)), command=making.command
        ),
        packages=_packages(requires),
        native="" if requires else Template(_NATIVE).substitute(command=making.command),
        steps=making.steps,
        states=making.states,
    )
    return framed(name, summary, card, version, "2.0", sections)


def framed(name: str, summary: str, card: str, version: str, fmi: str, sections: str) -> str:
    """Return documentation/index.html with these sections, which are HTML, behind the card.

    The page stands alone: links and pictures of the card point to nothing in an FMU and come out as
    their text, HTML in it as it is written. The result is XML as well.
    """
    return Template(FRAME.read_text("utf-8")).substitute(
        name=escape(name),
        summary=escape(summary.rstrip(".")),
        card=_rendered(card),
        version=escape(version),
        fmi=fmi,
        sections=sections,
    )


def _packages(requires: Sequence[str]) -> str:
    if not requires:
        return "No packages need to be installed."
    extras = escape(",".join(requires))
    *others, last = (f"<code>{escape(name)}</code>" for name in requires)
    packages = f"packages {', '.join(others)} and {last}" if others else f"package {last}"
    return (
        f"That Python must have the {packages}; "
        f"<code>python -m pip install 'grasp-cosim[{extras}]'</code> installs it."
    )


def _equation(tokens: Sequence[Any], index: int, *_: object) -> str:
    """Return the HTML of a fence with an equation and its number, if it has a tag; else nothing."""
    if tokens[index].info.strip() != "math":
        return ""
    from latex2mathml.converter import convert  # takes time to load

    tag = r"\\tag\{(.*?)\}"
    said = search(tag, tokens[index].content)
    # An element of HTML: it needs no namespace.
    math = sub(' xmlns="[^"]*"', "", convert(sub(tag, "", tokens[index].content), display="block"))
    number = f"<span>({escape(said[1])})</span>" if said else ""
    return f'<div class="equation"><div>{math}</div>{number}</div>\n'


def licences(files: Mapping[str, str] | None = None) -> dict[str, bytes]:
    """Return the files of documentation/licenses, each from an installed distribution.

    FileNotFoundError if one is not installed, or has no licence.
    """
    from importlib import metadata  # takes time to load

    found = {}
    for file, distribution in (files or _LICENCES).items():
        try:
            text = metadata.distribution(distribution).read_text("licenses/LICENSE")
        except metadata.PackageNotFoundError:
            text = None
        if not text:
            raise FileNotFoundError(
                f"{distribution}: no licenses/LICENSE among its metadata; install it with pip"
            )
        found[file] = text.encode()
    return found


def icon(name: str) -> bytes | None:
    """Return model.png of the FMU `name`; None where there is none for it."""
    file = ICONS / f"{name}.png"
    return file.read_bytes() if file.exists() else None


def _rendered(card: str) -> str:
    """Return the card as HTML, a heading level down: the page has its own title.

    Equations in LaTeX, in ```math, come out as MathML. Each cell of a table knows its head, for
    phones, where a row is shown as a list.
    """
    from markdown_it import MarkdownIt  # takes time to load

    card = sub(r"^<!--.*-->$", "", card.replace(BEGIN, "## Variables\n\n"), flags=MULTILINE)
    markdown = MarkdownIt("commonmark", {"html": False, "xhtmlOut": True}).enable("table")
    for rule in ("link_open", "link_close"):
        markdown.add_render_rule(rule, lambda *_: "")
    markdown.add_render_rule("image", lambda _, tokens, index, *__: escape(tokens[index].content))
    renderer: Any = markdown.renderer
    code = renderer.rules["fence"]
    markdown.add_render_rule("fence", lambda _, *given: _equation(*given) or code(*given))
    tokens = markdown.parse(card)
    heads: list[str] = []
    cells = cycle([""])
    for i, token in enumerate(tokens):
        if token.type == "thead_open":
            heads = []
        if token.type == "th_open":
            heads.append(tokens[i + 1].content)
        if token.type == "tbody_open":
            cells = cycle(heads)
        if token.type == "td_open":
            token.attrSet("data-head", next(cells))
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1]) + 1, 6)}"
    html: str = markdown.renderer.render(tokens, markdown.options, {})
    return html
