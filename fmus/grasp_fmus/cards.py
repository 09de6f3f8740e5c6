"""The variable tables of the equation cards, from the blocks' declarations.

`make cards` writes them; the tests check that they are up to date.
"""

import importlib
import sys
from pathlib import Path

from .contract import Block, Field, declared

BEGIN, END = "<!-- variables -->\n", "<!-- end of variables -->\n"


def updated(card: str, block: Block) -> str:
    """The text of a card with its variable table up to date; ValueError without the marks."""
    before, begin, rest = card.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"a card must have {BEGIN.strip()} and {END.strip()} around its table")
    return f"{before}{BEGIN}{variable_table(block)}{END}{after}"


def variable_table(block: Block) -> str:
    """The variables of a block as a Markdown table."""
    lines = [
        "| variable | causality | unit | start | range | feedthrough of | meaning |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| `{_name(f)}` | {'tunable ' if f.tunable else ''}{f.causality} | {f.unit} "
        f"| {_start(f)} | {_range(f)} | {_feedthrough(f)} | {f.description} |"
        for f in declared(block)
    ]
    return "\n".join(lines) + "\n"


def _name(f: Field) -> str:
    return ".".join(f.path) + (f"[1..{f.size}]" if f.size else "")


def _start(f: Field) -> str:
    starts = ["" if s is None else str(s).lower() for s in f.starts]
    return starts[0] if len(set(starts)) == 1 else ", ".join(starts)


def _range(f: Field) -> str:
    return f"{f.limits[0]:g} to {f.limits[1]:g}" if f.limits else ""


def _feedthrough(f: Field) -> str:
    if f.causality != "output":
        return ""
    return ", ".join(f"`{name}`" for name in sorted(f.feedthrough)) or "none"


def main(cards: list[str]) -> None:
    """Update the cards, each given as CARD=MODULE."""
    for card in cards:
        path, _, module = card.partition("=")
        block: Block = importlib.import_module(module)
        text = updated(Path(path).read_text("utf-8"), block)
        Path(path).write_text(text, "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
