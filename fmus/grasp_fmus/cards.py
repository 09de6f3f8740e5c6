"""The variable tables of the equation cards, from the blocks' declarations.

`make cards` writes them; the tests check that they are up to date.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from .contract import Block, Field, declared
from .package import card_file
from .page import BEGIN
from .shipped import blocks

END = "<!-- end of variables -->\n"


def updated(card: str, blocks: Mapping[str, Block]) -> str:
    """The text of the card of these blocks, by name, with its variables up to date.

    ValueError without the marks.
    """
    before, begin, rest = card.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"a card must have {BEGIN.strip()} and {END.strip()} around its table")
    return f"{before}{BEGIN}{variable_tables(blocks)}{END}{after}"


def variable_tables(blocks: Mapping[str, Block]) -> str:
    """The variables of a block as a Markdown table; of several, what all have, then what each adds.

    The blocks are given by name. Those of a hand follow by themselves.
    """
    rows = {name: [_row(f) for f in declared(block)] for name, block in blocks.items()}
    if len(rows) == 1:
        return _table(*rows.values())
    hands = {name: own for name, own in rows.items() if name.startswith("hand")}
    others = {name: own for name, own in rows.items() if name not in hands}
    parts = _parts("all have", others)
    if hands:
        parts |= _parts("all of a hand of three fingers have", hands)
    return "\n".join(_tables(parts))


def _parts(title: str, rows: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """What all have, and what each adds, by a title."""
    first, *others = rows.values()
    common = [row for row in first if all(row in other for other in others)]
    added = {f"`{name}` adds": [r for r in own if r not in common] for name, own in rows.items()}
    return {title: common, **{name: own for name, own in added.items() if own}}


def _tables(parts: Mapping[str, list[str]]) -> Iterator[str]:
    """Each part under its title; a row that stood before is named there, and not shown again."""
    seen: set[str] = set()
    for title, rows in parts.items():
        fresh = [row for row in rows if row not in seen]
        names = (row.split("`")[1].partition("[")[0] for row in rows if row in seen)
        groups = dict.fromkeys(
            f"`{name.partition('.')[0]}{'.*' if '.' in name else ''}`" for name in names
        )
        again = f", besides {', '.join(groups)} as above" if groups else ""
        yield f"What {title}{again}:\n\n{_table(fresh)}" if fresh else f"What {title}{again}.\n"
        seen |= {*rows}


def _table(rows: list[str]) -> str:
    head = "| variable | causality | unit | start | range | feedthrough of | meaning |"
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows, ""])


def _row(f: Field) -> str:
    name = ".".join(f.path) + (f"[1..{f.size}]" if f.size else "")
    tunable = "tunable " if f.tunable else ""
    limits = f"{f.limits[0]:g} to {f.limits[1]:g}" if f.limits else ""
    items = {}
    if f.enumeration:
        items = {number: item for item, number in f.enumeration.items}
        limits = ", ".join(items.values())
    starts = ["" if s is None else items.get(s, str(s).lower()) for s in f.starts]
    start = starts[0] if len(set(starts)) == 1 else ", ".join(starts)
    reached_by = ", ".join(f"`{source}`" for source in sorted(f.feedthrough))
    if f.causality == "output" and not reached_by:
        reached_by = "none"
    return (
        f"| `{name}` | {tunable}{f.causality} | {f.unit} "
        f"| {start} | {limits} | {reached_by} | {f.description} |"
    )


def blocks_by_card() -> dict[Path, dict[str, Block]]:
    """Return the blocks that have a script, by the names of their modules, card by card."""
    cards: dict[Path, dict[str, Block]] = {}
    for block in blocks().values():
        package, _, name = block.__name__.partition(".")
        cards.setdefault(card_file(package), {})[name] = block
    return cards


def main() -> None:
    """Update the cards."""
    for card, described in blocks_by_card().items():
        card.write_text(updated(card.read_text("utf-8"), described), "utf-8")


if __name__ == "__main__":
    main()
