"""The command relay."""

import csv
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ...checks import integer, known, real
from ...errors import InputError
from ...files import FULL
from ...hil.address import Address, is_loopback, text
from ...hil.network import DIRECTIONS, Conditions, Network, Outage
from ...hil.relay import Relay
from ...hil.traffic import Entry, Log
from ...interruption import interrupts
from ..frame import PATH, json_option, pair, say, show

NUMBERS = ("delay", "jitter", "loss", "duplicate", "reorder", "reorder_by")
WHOLE = ("seed", "capacity")
"""The names that --set takes."""


@click.command()
@click.option("--to", "peer", required=True, metavar="HOST:PORT", help="Address of the peer.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at.")
@click.option(
    "--port",
    type=click.IntRange(0, 65_535),
    default=0,
    help="Port to listen at. Default: a free one.",
)
@click.option("--delay", type=float, metavar="S", help="Each datagram is so late, in s.")
@click.option("--loss", type=float, metavar="P", help="Probability that a datagram is lost.")
@click.option(
    "--outage",
    "outages",
    multiple=True,
    metavar="FROM:UNTIL",
    help="Nothing gets through: numbers of requests, or s since the first as in 0.5s:2s.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="jitter and reorder_by in s; probabilities duplicate and reorder; seed; capacity.",
)
@click.option("--log", type=PATH, help="CSV to write with the fate of each datagram.")
@json_option
def relay(
    peer: str,
    host: str,
    port: int,
    delay: float | None,
    loss: float | None,
    outages: tuple[str, ...],
    settings: tuple[str, ...],
    log: Path | None,
    as_json: bool,
) -> int:
    """Relay UDP datagrams through a bad network, until Ctrl-C.

    They go to a peer and back, both ways under the same conditions. The n-th datagram of a
    direction has the same fate whenever the seed is the same. A jitter is added to the delay; a
    datagram that is reordered is held back by reorder_by, 0.02 s; beyond the capacity, 4096
    datagrams under way, more are dropped. Counts are printed at the end.

    \b
    Example: grasp-cosim relay --port 5600 --to 127.0.0.1:5501 --loss 0.01 --set seed=1
    """
    given = {"delay": delay, "loss": loss}
    network = _network({k: v for k, v in given.items() if v is not None}, settings, outages)
    with (
        _written(log) as note,
        Relay(_address(peer), network, host=host, port=port, log=note) as relay,
    ):
        with interrupts(relay.stop):
            _say(relay)
            relay.run()
        show(as_json, _report(relay, network.seed), _table(relay))
    return 0


def _network(given: dict[str, float], settings: Iterable[str], outages: Iterable[str]) -> Network:
    """The network of the options, of which each value is given once."""
    for setting in settings:
        name, value = pair("--set", setting, "NAME=VALUE")
        known("--set", name, (*NUMBERS, *WHOLE))
        if name in given:
            raise InputError(f"--set {setting}: {name} is given twice; must be given once")
        try:
            given[name] = integer(value) if name in WHOLE else real(value)
        except ValueError:
            raise InputError(f"--set {setting}: must be a number") from None
    both = dict.fromkeys(DIRECTIONS, Conditions(**{n: given[n] for n in NUMBERS if n in given}))
    whole = {n: int(given[n]) for n in WHOLE if n in given}
    return Network(both, tuple(map(_outage, outages)), **whole)


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
