"""The command relay."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from ...base.errors import InputError
from ...base.interruption import interrupts
from ...hil.relay import DIRECTIONS, Conditions, Network, Outage, Relay, csv_log
from ...hil.sockets import is_loopback, read_address, text
from ..frame import PATH, json_option, say, show


def _span(_: Any, __: Any, given: str) -> tuple[float, float]:
    """The shortest and the longest delay in s."""
    with suppress(ValueError):
        low, high = (2 * [float(part) for part in given.split(":", 1)])[:2]
        if not high < low:
            return low, high
    raise InputError(f"--delay {given!r}: must be S or FROM:TO, in s, the longer last")


@click.command()
@click.argument("listen")
@click.argument("to")
@click.option(
    "--delay",
    default="0",
    callback=_span,
    metavar="S|FROM:TO",
    help="Time that a datagram takes in s; anything from one to the other, or always as long.",
)
@click.option("--loss", type=float, default=0.0, help="Probability that a datagram is lost.")
@click.option("--duplicate", type=float, default=0.0, help="Probability that it comes twice.")
@click.option("--reorder", type=float, default=0.0, help="Probability that it takes 20 ms more.")
@click.option(
    "--outage",
    "outages",
    multiple=True,
    metavar="FROM:UNTIL",
    help="Nothing gets through: numbers of requests, or s since the first as in 0.5s:2s.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    show_default=True,
    help="Another number has other datagrams lost, late or doubled.",
)
@click.option("--log", type=PATH, help="CSV to write with the fate of each datagram.")
@json_option
def relay(
    listen: str,
    to: str,
    delay: tuple[float, float],
    outages: tuple[str, ...],
    seed: int,
    log: Path | None,
    as_json: bool,
    **chances: float,
) -> int:
    """Relay UDP datagrams through a bad network, until Ctrl-C.

    They go from LISTEN to TO and back, both ways under the same conditions. Each of the two is
    HOST:PORT, or PORT of this machine; LISTEN may be 0, for one that is free. The n-th datagram of
    a direction has the same fate whenever the seed is the same. Counts are printed at the end.

    \b
    Example: grasp-cosim relay 5600 127.0.0.1:5501 --delay 0.001 --loss 0.01 --seed 1
    """
    both = Conditions(delay[0], delay[1] - delay[0], **chances)
    network = Network(dict.fromkeys(DIRECTIONS, both), tuple(map(Outage.read, outages)), seed)
    host, port = read_address("LISTEN", listen)
    with (
        csv_log(log) as note,
        Relay(read_address("TO", to), network, host=host, port=port, log=note) as relay,
        interrupts(relay.stop),
    ):
        here, there = text(relay.address), text(relay.peer)
        if not is_loopback(relay.address):
            say(f"listening beyond this machine: whoever reaches {here} reaches {there}")
        say(f"relaying {here} -> {there}")
        relay.run()
    show(as_json, relay.as_json(), relay.as_text())
    return 0
