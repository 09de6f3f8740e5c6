"""The command ssp."""

from pathlib import Path

import click

from ...base.files import check_file
from ..frame import PATH, json_option, say, show
from ..options import chosen_system, set_option


@click.command()
@click.argument("system", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, required=True, help="Archive to write, an .ssp.")
@set_option
@json_option
def ssp(system: Path | None, out: Path, settings: tuple[str, ...], as_json: bool) -> int:
    """Write SYSTEM as an SSP 1.0 archive.

    SYSTEM is a .toml or .ssp file, by default the built-in grasp. An .ssp without a step gets one
    by --set experiment.step=1e-3.

    \b
    Example: grasp-cosim ssp my_system.toml -o my_system.ssp
    """
    from ...ssp.to_archive import write_ssp  # only here: its libraries take time to load

    chosen = chosen_system({"system": system, "settings": settings})
    check_file(out)
    written = write_ssp(chosen, out)
    report = {
        "ssp": str(out),
        "entries": list(written.entries),
        "components": [c.name for c in chosen.components],
        "connections": len(chosen.connections),
        "notes": [*chosen.notes, *written.notes],
    }
    show(as_json, report, "\n    ".join((f"{out}: written", *written.entries)))
    if not as_json:
        for note in written.notes:
            say(note)
    return 0
