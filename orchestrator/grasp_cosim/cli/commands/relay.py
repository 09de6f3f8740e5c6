"""The command relay."""

import csv
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ...errors import InputError
from ...files import FULL
from ...hil.address import Address, is_loopback, text
from ...hil.network import DIRECTIONS, Conditions, Network, Outage, check_time
from ...hil.relay import Relay
from ...hil.traffic import Entry, Log
from ...interruption import interrupts
from ...system.parts import NANOSECONDS
from ..frame import INTERRUPTED, PATH, Command, fail, json_option, say, show


def _number(name: str, unit: str, text: str, default: float = 0.0) -> Command:
    """An option that is a number in a unit: s, or P for a probability."""
    return click.option(
        f"--{name}",
        type=float,
        default=default,
        show_default=bool(default),
        metavar=unit,
        help=text,
    )


@click.command()
@click.option("--to", "peer", required=True, metavar="HOST:PORT", help="The peer.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option(
    "--port", type=click.IntRange(0, 65_535), default=0, help="Default: one that is free."
)
@_number("delay", "S", "Of every datagram.")
@_number("jitter", "S", "Up to so much more delay.")
@_number("loss", "P", "Probability, 0 to 1.")
@_number("duplicate", "P", "Probability, 0 to 1.")
@_number("reorder", "P", "Probability, 0 to 1.")
@_number("reorder-by", "S", "How long --reorder holds a datagram back.", Conditions().reorder_by)
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
    help="Of another seed other datagrams are lost, late or doubled.",
)
@click.option(
    "--capacity",
    type=click.IntRange(1),
    default=Network().capacity,
    show_default=True,
    help="Datagrams under way at most; more are dropped.",
)
@click.option("--duration", type=float, metavar="S", help="Default: until Ctrl-C.")
@click.option("--log", type=PATH, help="CSV with the fate of each datagram.")
@json_option
def relay(
    peer: str,
    host: str,
    port: int,
    outages: tuple[str, ...],
    seed: int,
    capacity: int,
    duration: float | None,
    log: Path | None,
    as_json: bool,
    **conditions: float,
) -> int:
    """Relay UDP datagrams through a nasty network, until Ctrl-C.

    They go to a peer and back. The n-th datagram of a direction has the same fate whenever the seed
    is the same. Both directions have the same conditions. Counts are printed at the end. Exit code
    130 where a --duration was cut short.

    \b
    Example: grasp-cosim relay --port 5600 --to 127.0.0.1:5501 --delay 0.001 --loss 0.01 --seed 1
    """
    if duration is not None:
        check_time("duration", duration)
    end = None if duration is None else round(duration * NANOSECONDS)
    both = dict.fromkeys(DIRECTIONS, Conditions(**conditions))
    network = Network(both, tuple(map(_outage, outages)), seed, capacity)
    with (
        _written(log) as note,
        Relay(_address(peer), network, host=host, port=port, log=note) as relay,
    ):
        with interrupts(relay.stop) as came:
            _say(relay)
            relay.run(end)
        show(as_json, _report(relay, seed), _table(relay))
    if came.is_set() and duration is not None:
        return fail(f"interrupted before --duration {duration!r} was over", INTERRUPTED)
    return 0


def _address(peer: str) -> Address:
    host, _, port = peer.rpartition(":")
    if not (host and re.fullmatch("[0-9]{1,5}", port)):
        raise InputError(f"--to {peer!r}: must be HOST:PORT, as in 127.0.0.1:5501")
    return host, int(port)


def _outage(given: str) -> Outage:
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)(s?):([0-9]+(?:\.[0-9]+)?)\2", given)
    if not found:
        raise InputError(
            f"--outage {given!r}: must be FROM:UNTIL, in numbers of requests, as in 100:200,"
            " or in s, as in 0.5s:2s"
        )
    return Outage(float(found[1]), float(found[3]), "s" if found[2] else "requests")


@contextmanager
def _written(path: Path | None) -> Iterator[Log | None]:
    if path is None:
        yield None
        return
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(Entry._fields)
            yield table.writerow
    except OSError as error:  # of a disk it does not say where
        if error.errno in FULL:
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


def _say(relay: Relay) -> None:
    if not is_loopback(relay.address):
        note = f"listening beyond this machine: whoever reaches {text(relay.address)} reaches"
        say(f"{note} {text(relay.peer)}")
    say(f"relaying {text(relay.address)} -> {text(relay.peer)}")


def _report(relay: Relay, seed: int) -> Mapping[str, Any]:
    counts: dict[str, Any] = {
        d: {**asdict(c), "dropped": c.dropped} for d, c in relay.counters.items()
    }
    return {"listening": text(relay.address), "to": text(relay.peer), "seed": seed} | counts


def _table(relay: Relay) -> str:
    rows = {direction: asdict(c) for direction, c in relay.counters.items()}
    names = list(rows["request"])
    lines = [" " * 8 + "".join(f"{name:>12s}" for name in names)]
    lines += [f"{d:8s}" + "".join(f"{row[n]:12d}" for n in names) for d, row in rows.items()]
    return "\n".join(lines)
