"""What an FMU holds for its reader: documentation/index.html, the licences, the icon."""

from collections.abc import Sequence
from html import escape
from importlib import metadata
from pathlib import Path
from re import MULTILINE, sub
from string import Template
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.renderer import RendererHTML
from markdown_it.token import Token
from markdown_it.utils import EnvType, OptionsDict

from .cards import BEGIN

ICONS = Path(__file__).parent / "icons"

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8" />
<meta name="viewport" content="width=device-width" />
<title>$name</title>
<style>
:root { color-scheme: light dark; }
body { max-width: 64em; margin: 2em auto; padding: 0 1em; }
body { font-family: sans-serif; line-height: 1.5; }
h2 { margin-top: 2em; padding-bottom: 0.2em; border-bottom: 1px solid #888; }
pre { padding: 0.6em 1em; border-left: 4px solid #888; overflow: auto; line-height: 1.4; }
table { border-collapse: collapse; }
th, td { padding: 0.3em 0.7em; border: 1px solid #888; text-align: left; vertical-align: top; }
td:first-child { white-space: nowrap; }
</style>
</head>
<body>
<h1>$name</h1>
<p>$summary.</p>
<p>FMI 2.0 for co-simulation, made by grasp-cosim $version.</p>
$card
<h2>How the host must find Python</h2>
<p>This FMU runs Python code inside the binary of pythonfmu, in the process of the host: 64 bit, on
Linux or Windows, Python 3.11 or newer. $packages</p>
<table>
<thead>
<tr><th>host</th><th>what it needs</th></tr>
</thead>
<tbody>
<tr><td>a Python process</td><td>nothing</td></tr>
<tr><td>any other process on Linux</td><td>$linux</td></tr>
<tr><td>any other process on Windows</td><td><code>python3.dll</code> and
<code>python3x.dll</code>, say <code>python311.dll</code>, on the <code>PATH</code></td></tr>
</tbody>
</table>
<p>The path of the folder that the host extracts the FMU to must be made of ASCII letters, digits,
<code>_ . - ~</code> and spaces: any other character crashes pythonfmu's loader, and the host with
it. A host that is not Python must have made its first instance before other threads make theirs.
The GUID is not checked.</p>
<p><code>grasp-cosim doctor $name.fmu</code> checks all of this on the host's machine and names the
fix.</p>
<h2>Errors</h2>
<p>A refused call returns <code>fmi2Error</code> and has no effect. The reason is in the log even
when debug logging is off: instance, time, variable, value and the allowed range. On Windows it
returns <code>fmi2Fatal</code>, and the log needs debug logging.</p>
<p>$steps</p>
<h2>State</h2>
<p>$states</p>
<h2>Licence</h2>
<p>MIT, <a href="licenses/license.txt">licenses/license.txt</a>. The binary comes from pythonfmu,
MIT as well, <a href="licenses/pythonfmu.txt">licenses/pythonfmu.txt</a>.</p>
</body>
</html>
""")

_LICENCES = {"license.txt": "grasp-cosim", "pythonfmu.txt": "pythonfmu"}
"""Whose licence is in which file of documentation/licenses."""


_ANY = """A libpython in the process: start the host with
<code>LD_PRELOAD=libpython3.x.so.1.0</code>, say <code>libpython3.11.so.1.0</code>, or use an FMU
built with <code>grasp-cosim $command --bind-python</code>. Python's standard library is found
through <code>PYTHONHOME</code>, or through <code>python3</code> on the <code>PATH</code>."""
_BOUND = """Nothing where there is <code>$library</code>, to which this FMU is bound: it brings it
along, and knows where its standard library is. On another machine build it there."""
"""What a host on Linux needs."""


class Making(NamedTuple):
    """What is said of an FMU by what it was made from: the command, steps and states, as HTML."""

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
    """documentation/index.html of the FMU name, from its card in Markdown.

    library is the libpython to which the FMU is bound, if it is; requires are the extras of
    grasp-cosim, each called as its package, that it needs in the host's Python.

    The page stands alone: links and pictures of the card point to nothing in an FMU and come out as
    their text, HTML in it as it is written. The result is XML as well.
    """
    return _PAGE.substitute(
        name=escape(name),
        summary=escape(summary.rstrip(".")),
        card=_rendered(card),
        version=escape(version),
        linux=(
            Template(_BOUND).substitute(library=escape(str(library)))
            if library
            else Template(_ANY).substitute(command=making.command)
        ),
        packages=_packages(requires),
        steps=making.steps,
        states=making.states,
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


def licences() -> dict[str, bytes]:
    """The files of documentation/licenses, read from the installed distributions.

    FileNotFoundError if one is not installed, or has no licence.
    """
    return {file: _licence(distribution) for file, distribution in _LICENCES.items()}


def icon(name: str) -> bytes:
    """model.png of the FMU name; FileNotFoundError if there is none."""
    try:
        return (ICONS / f"{name}.png").read_bytes()
    except FileNotFoundError as error:
        raise FileNotFoundError(f"{name}: no icon; fmus/draw_icons.py draws one") from error


def _licence(distribution: str) -> bytes:
    try:
        text = metadata.distribution(distribution).read_text("licenses/LICENSE")
    except metadata.PackageNotFoundError:
        text = None
    if not text:
        raise FileNotFoundError(
            f"{distribution}: no licenses/LICENSE among its metadata; install it with pip"
        )
    return text.encode()


def _rendered(card: str) -> str:
    """The card as HTML, a heading level down: the page has its own title."""
    card = sub(r"^<!--.*-->$", "", card.replace(BEGIN, "## Variables\n\n"), flags=MULTILINE)
    markdown = MarkdownIt("commonmark", {"html": False, "xhtmlOut": True}).enable("table")
    for rule in ("link_open", "link_close"):
        markdown.add_render_rule(rule, _nothing)
    markdown.add_render_rule("image", _text)
    tokens = markdown.parse(card)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(int(token.tag[1]) + 1, 6)}"
    html: str = markdown.renderer.render(tokens, markdown.options, {})
    return html


def _nothing(
    renderer: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: EnvType
) -> str:
    return ""


def _text(
    renderer: RendererHTML, tokens: Sequence[Token], index: int, options: OptionsDict, env: EnvType
) -> str:
    return escape(tokens[index].content)
