"""The command serve."""

from pathlib import Path

import click

from ...base.interruption import interrupts
from ...hil.proxy import LONGEST_SILENCE, exchanged, shared_key
from ...hil.served import DEFAULT_ADDRESS, ServedFmu, Server, Service
from ...hil.sockets import is_loopback, text
from ...system.parts import in_nanoseconds
from ..frame import INTERRUPTED, PATH, fail, json_option, pair, say, show


@click.command()
@click.argument("fmu", type=PATH)
@click.option("--host", default=DEFAULT_ADDRESS[0], show_default=True, help="Address to listen at.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_ADDRESS[1],
    show_default=True,
    help="UDP port to listen at; 0 takes one that is free.",
)
@click.option("--lockstep", is_flag=True, help="Step when asked, not by the clock.")
@click.option(
    "--watchdog",
    type=float,
    default=0.1,
    show_default=True,
    help="Longest silence in s; after it the inputs are safe values.",
)
@click.option(
    "--failsafe",
    multiple=True,
    metavar="INPUT=VALUE",
    help="Safe value of an input. Default: its start value.",
)
@click.option("--key-file", type=PATH, help="A file with a key that the proxy has, too.")
@click.option("--sessions", type=click.IntRange(1), help="End after so many sessions.")
@json_option
def serve(
    fmu: Path,
    host: str,
    port: int,
    lockstep: bool,
    watchdog: float,
    failsafe: tuple[str, ...],
    key_file: Path | None,
    sessions: int | None,
    as_json: bool,
) -> int:
    """Serve FMU to a proxy, as a bench would, until interrupted.

    It runs in real time, or with --lockstep one step at a request: then a loop over the proxy gives
    the same values as one without. At the end it prints how much came. The exit code is 0, also
    after Ctrl-C, but 130 where that came before --sessions were served.

    \b
    Example: grasp-cosim serve fmus/build/GripperPlant.fmu --lockstep
    """
    service = Service(
        lockstep,
        watchdog_ns=in_nanoseconds("--watchdog", watchdog),
        failsafe=dict(pair("--failsafe", text, "INPUT=VALUE") for text in failsafe),
        key=None if key_file is None else shared_key(key_file, say),
    )
    served = ServedFmu(exchanged(fmu), service, say)
    with Server(served, (host, port), say) as server:
        for note in served.notes:
            say(note)
        at = text(server.address)
        say(f"serving {fmu.name} at {at}, {'lockstep' if lockstep else 'real time'}")
        if key_file is None:
            who = "any program here" if is_loopback(server.address) else "whoever can reach it"
            say(
                f"{at} without a key: {who} may take part, and take over a session that is silent "
                f"for {LONGEST_SILENCE:g} s; --key-file keeps others out"
            )
        with interrupts(server.stop) as came:
            server.serve(sessions)
        counters = served.counters()
    came_in = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
    show(as_json, {"listening": at, **counters}, came_in or "nothing came")
    if came.is_set() and sessions:
        served_so_far = f"{counters['sessions']} of {sessions} sessions served"
        return fail(f"interrupted; {served_so_far}", INTERRUPTED)
    return 0
