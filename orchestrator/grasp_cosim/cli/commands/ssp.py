"""The command ssp."""

from pathlib import Path

import click

from ...files import check_folder
from ..frame import PATH, json_option, load_system, say, show


@click.command()
@click.argument("system", required=False, type=PATH)
@click.option("-o", "--out", type=PATH, required=True, help="The archive to write.")
@click.option("--step", type=float, help="Communication step in s, for an .ssp that names none.")
@click.option("--stop", type=float, help="Stop time in s.")
@json_option
def ssp(
    system: Path | None, out: Path, step: float | None, stop: float | None, as_json: bool
) -> int:
    """Write SYSTEM as an SSP 1.0 archive.

    It is a .toml or .ssp file, by default the built-in grasp.

    \b
    Example: grasp-cosim ssp my_system.toml -o my_system.ssp
    """
    from ...ssp.write import write_ssp  # only here: its libraries take time to load

    chosen = load_system(system, step, stop).with_experiment(step, stop)
    check_folder(out.parent)
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
