"""Makes what an FMU holds for its reader: documentation/index.html, the licences, the icon.

A page is Markdown: the equation sheet, and the sections below. Its frame is page.html.in. The
tables of variables in the equation sheets are made here too: `make tables` brings them up to date.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from itertools import cycle
from pathlib import Path
from re import MULTILINE, match, search, sub
from string import Template
from typing import Any

from .contract import Block, Field, declared
from .description import version
from .shipped import blocks, sheet_file

ICONS = Path(__file__).parent / "icons"
FRAME = Path(__file__).with_name("page.html.in")

BEGIN, END = "<!-- variables -->\n", "<!-- end of variables -->\n"
"""In an equation sheet, around the tables of the variables."""

PYTHON = """\
## What the host needs

To be a Python process, 3.11 or newer, 64 bit, on Linux or Windows: this FMU runs Python code inside
the binary of pythonfmu. $packages For a host that is not Python, or another processor, take the
native FMU: `grasp-cosim build --native`. The path of the folder that the host extracts the FMU to
must be made of ASCII letters, digits, `_ . - ~` and spaces: any other character crashes pythonfmu's
loader, and the host with it. `grasp-cosim inspect $name.fmu` says whether this machine can load it.

## Errors

A call that is refused has no effect and returns `fmi2Fatal`: a value out of range, a step that is
too long, or one whose results would not be finite. The reason is in the log of the host where
debug logging is on: instance, time, variable, value and what would be valid.
"""
_COMPILED = """
## Compiling the sources

`sources/` holds all of it as C99. One file is compiled, `$name.c`, which includes the others:

    cc -std=c99 -O2 -ffp-contract=off -D$override -shared -fPIC -o $name.so $name.c -lm

It compiles without warnings with `-Wall -Wextra -Wpedantic`. All functions but those of FMI are
`static`, and without `-D$override` these begin with `${name}_`: any number of such FMUs can be
linked into one program.

## Errors

A call that is refused returns `fmi${fmi}Error` and has no effect. The reason is in the log even
when debug logging is off: instance, time, variable, value and what would be valid."""
NATIVE = f"""\
## What the host needs

Nothing but a binary for its platform: this FMU needs no Python, no other library than those of the
system, no files, and no time or environment. It allocates memory when it is instantiated and never
after that, and reads nothing from the folder that the host extracts it to.
{_COMPILED} A step
that is too long, or whose results would not be finite, returns `fmi${{fmi}}Discard`.

## What is promised of the numbers

On Linux with glibc, on x86-64 and aarch64, they are those of the same block in Python, bit for bit;
elsewhere libm rounds otherwise now and then. Compiled with contraction of a·b+c (`-march=native`
without `-ffp-contract=off`) or with `-ffast-math`, the FMU refuses to be instantiated.
"""
PROXY = f"""\
## What the host needs

A binary for its platform, and a peer in reach: this FMU needs no Python. It has one UDP socket to
its peer, reads the monotonic clock, and random bytes for each session; a file only where
`proxy.key_file` names one. On Windows its sources are linked with `ws2_32`.
{_COMPILED}

A step without an answer in time returns `fmi${{fmi}}OK`: `proxy.state` says what became of it, and
the log that the peer is lost. With `proxy.on_loss = stop` the step in which it is lost returns
`fmi${{fmi}}Error`, and so does every later one.
"""
"""The text on each kind of FMU, in Markdown."""

_STATES = """Getting, setting, freeing and serialising the state are supported. A state can be
exchanged between instances of the same FMU, its bytes also between the one in Python and the native
one."""


def page(name: str, summary: str, sheet: str, about: str, fmi: int = 2, packages: str = "") -> str:
    """Return documentation/index.html of an FMU, from its equation sheet and the text on its kind.

    Both are in Markdown; `about` is one of PYTHON, NATIVE, PROXY. The page stands on its own: links
    and pictures of the equation sheet point to nothing in an FMU and come out as their text. HTML
    in it stays as it is. The result is XML too.
    """
    of_pythonfmu = ", the binary of pythonfmu too: documentation/licenses/pythonfmu.txt"
    licence = f"MIT: documentation/licenses/license.txt{of_pythonfmu if about is PYTHON else ''}."
    states = "Not supported: the state is that of the peer." if about is PROXY else _STATES
    override = f"FMI{fmi}_OVERRIDE_FUNCTION_PREFIX"
    sections = Template(f"{about}\n## States\n\n{states}\n\n## Licence\n\n{licence}\n").substitute(
        name=name, fmi=fmi, override=override, packages=packages
    )
    return Template(FRAME.read_text("utf-8")).substitute(
        name=escape(name),
        summary=escape(summary.rstrip(".")),
        version=escape(version()),
        fmi=f"{fmi}.0",
        sheet=_rendered(sheet, 1),
        sections=_rendered(sections, 0),
    )


def needed(packages: Sequence[str]) -> str:
    """Say which packages must be installed in the Python of the host."""
    names = ", ".join(f"`{name}`" for name in packages)
    return f"That Python must have {names}." if names else "No packages need to be installed."


def licences(*distributions: str) -> dict[str, bytes]:
    """Return the licences of installed distributions, ours and others', as files of an FMU.

    FileNotFoundError if one has no licence.
    """
    from importlib import metadata  # takes time to load

    files = {}
    for name in distributions:
        text = metadata.distribution(name).read_text("licenses/LICENSE")
        if not text:
            reason = "no licenses/LICENSE among its metadata; install it with pip"
            raise FileNotFoundError(f"{name}: {reason}")
        file = "license" if name == "grasp-cosim" else name
        files[f"documentation/licenses/{file}.txt"] = text.encode()
    return files


def icon(name: str) -> bytes | None:
    """Return model.png of the FMU `name`; None where there is none for it."""
    file = ICONS / f"{name}.png"
    return file.read_bytes() if file.exists() else None


@cache
def _rendered(text: str, down: int) -> str:
    """Return Markdown as HTML, headings some levels down: the page has its own title.

    Equations in LaTeX, in ```math or between dollar signs, come out as MathML. Each cell of a table
    knows its head, for phones, where a row is shown as a list.
    """
    from markdown_it import MarkdownIt  # takes time to load

    text = sub(r"^<!--.*-->$", "", text.replace(BEGIN, "## Variables\n\n"), flags=MULTILINE)
    markdown = MarkdownIt("commonmark", {"html": False, "xhtmlOut": True}).enable("table")
    markdown.inline.ruler.before("escape", "symbol", _symbol)
    markdown.add_render_rule("symbol", lambda _, tokens, index, *__: _math(tokens[index].content))
    for rule in ("link_open", "link_close"):
        markdown.add_render_rule(rule, lambda *_: "")
    markdown.add_render_rule("image", lambda _, tokens, index, *__: escape(tokens[index].content))
    renderer: Any = markdown.renderer
    code = renderer.rules["fence"]
    markdown.add_render_rule(
        "fence", lambda _, *arguments: _equation(*arguments) or code(*arguments)
    )
    tokens = markdown.parse(text)
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
            token.tag = f"h{min(int(token.tag[1]) + down, 6)}"
    html: str = markdown.renderer.render(tokens, markdown.options, {})
    return html


def _equation(tokens: Sequence[Any], index: int, *_: object) -> str:
    """Return the HTML of a fence with an equation and its number, if it has a tag; else nothing."""
    if tokens[index].info.strip() != "math":
        return ""
    tag = r"\\tag\{(.*?)\}"
    number_tag = search(tag, tokens[index].content)
    math = _math(sub(tag, "", tokens[index].content), "block")
    number = f"<span>({escape(number_tag[1])})</span>" if number_tag else ""
    return f'<div class="equation"><div>{math}</div>{number}</div>\n'


def _math(latex: str, display: str = "inline") -> str:
    """Return LaTeX as MathML, an element of HTML: it needs no namespace."""
    from latex2mathml.converter import convert  # takes time to load

    return sub(' xmlns="[^"]*"', "", convert(latex, display=display))


def _symbol(state: Any, silent: bool) -> bool:
    """Read a symbol between dollar signs, a rule of markdown-it; False if there is none."""
    if not (found := match(r"\$(?!\s)([^$]+)(?<!\s)\$", state.src[state.pos :])):
        return False
    if not silent:
        state.push("symbol", "", 0).content = found[1]
    state.pos += found.end()
    return True


# The tables of variables in the equation sheets


def updated(sheet: str, blocks: Mapping[str, Block]) -> str:
    """The text of the equation sheet of these blocks, by name, with its variables up to date.

    ValueError without the marks.
    """
    head, begin, remainder = sheet.partition(BEGIN)
    _, end, tail = remainder.partition(END)
    if not (begin and end):
        raise ValueError(f"a sheet must have {BEGIN.strip()} and {END.strip()} around its table")
    return f"{head}{BEGIN}{variable_tables(blocks)}{END}{tail}"


def variable_tables(blocks: Mapping[str, Block]) -> str:
    """The variables of a block as a Markdown table; of several, the common ones, then the others.

    The blocks are given by name. Those of a gripper in tandem and of a hand follow by themselves. A
    row that stood before is named, and not shown again.
    """
    rows = {name: [_row(f) for f in declared(block)] for name, block in blocks.items()}
    if len(rows) == 1:
        return _table(*rows.values())
    tandems = {
        name: rows_of_block for name, rows_of_block in rows.items() if name.startswith("tandem")
    }
    hands = {name: rows_of_block for name, rows_of_block in rows.items() if name.startswith("hand")}
    grippers = {
        name: rows_of_block for name, rows_of_block in rows.items() if name not in tandems | hands
    }
    kinds = {
        "Common variables, two fingers": grippers,
        "Common variables, fingers in tandem": tandems,
        "Common variables, hand of three fingers": hands,
    }
    parts: dict[str, list[str]] = {}
    for who, group in kinds.items():
        first, *remaining = group.values() or [[]]
        common = [row for row in first if all(row in rows_of_block for rows_of_block in remaining)]
        added = {
            f"Further variables of `{n}`": [r for r in rows_of_block if r not in common]
            for n, rows_of_block in group.items()
        }
        parts |= {
            title: rows_of_block
            for title, rows_of_block in {who: common, **added}.items()
            if rows_of_block
        }
    shown_rows: set[str] = set()
    text = []
    for title, rows_of_block in parts.items():
        names = (row.split("`")[1].partition("[")[0] for row in rows_of_block if row in shown_rows)
        groups = (f"`{name.partition('.')[0]}{'.*' if '.' in name else ''}`" for name in names)
        families = ", ".join(dict.fromkeys(groups))
        again = f": {families} (as above)" if families else ""
        fresh = [row for row in rows_of_block if row not in shown_rows]
        further = f"{', and' if again else ''}:\n\n{_table(fresh)}" if fresh else ".\n"
        text.append(f"{title}{again}{further}")
        shown_rows |= {*rows_of_block}
    return "\n".join(text)


def _table(rows: list[str]) -> str:
    head = "| variable | causality | unit | start | range | feedthrough of | meaning |"
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows, ""])


def _row(f: Field) -> str:
    name = f.name + (f"[1..{f.size}]" if f.size else "")
    tunable = "tunable " if f.variability == "tunable" else ""
    limits = f"{f.limits[0]:g} to {f.limits[1]:g}" if f.limits else ""
    items = {}
    if f.enumeration:
        items = {number: item for item, number in f.enumeration.items}
        limits = ", ".join(items.values())
    starts = ["" if s is None else items.get(s, str(s).lower()) for s in f.starts]
    start = starts[0] if len(set(starts)) == 1 else ", ".join(starts)
    reached_by = ", ".join(f"`{source}`" for source in f.dependencies)
    if f.causality == "output" and not reached_by:
        reached_by = "none"
    cells = f"`{name}`", tunable + f.causality, f.unit, start, limits, reached_by, f.description
    return f"| {' | '.join(cells)} |"


def blocks_by_sheet() -> dict[Path, dict[str, Block]]:
    """Return the blocks that have a script, by the names of their modules, sheet by sheet."""
    sheets: dict[Path, dict[str, Block]] = {}
    for block in blocks().values():
        package, _, name = block.__name__.partition(".")
        sheets.setdefault(sheet_file(package), {})[name] = block
    return sheets


def main() -> None:
    """Bring the equation sheets up to date."""
    for sheet, described in blocks_by_sheet().items():
        sheet.write_text(updated(sheet.read_text("utf-8"), described), "utf-8")


if __name__ == "__main__":
    main()
