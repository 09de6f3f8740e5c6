"""The commands of hardware in the loop: serve an FMU, relay through a bad network."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click

from ..base.errors import InputError
from ..base.interruption import interrupts
from ..hil.network_conditions import WORDS, Conditions, Network, Outage
from ..hil.proxy_of_fmu import LONGEST_SILENCE, exchanged, shared_key
from ..hil.rehearsal import MEANINGS, Rehearsed
from ..hil.relay import Relay, csv_log
from ..hil.served import ServedFmu, Service
from ..hil.server import DEFAULT_ADDRESS, Server
from ..hil.sockets import is_loopback, read_address, text
from ..system.times import in_nanoseconds
from .frame import INTERRUPTED, PATH, fail, json_option, pair, say, show


@click.command()
@click.argument("fmu", type=PATH)
@click.option("--host", default=DEFAULT_ADDRESS[0], help="Address to listen at.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_ADDRESS[1],
    help="UDP port to listen at; 0 takes one that is free.",
)
@click.option("--lockstep", is_flag=True, help="Step when asked, not by the clock.")
@click.option(
    "--watchdog",
    type=float,
    default=0.1,
    help="Longest silence in s; after it the inputs are safe values.",
)
@click.option(
    "--failsafe",
    multiple=True,
    metavar="INPUT=VALUE",
    help="Safe value of an input. Default: its start value.",
)
@click.option("--key-file", type=PATH, help="A file with a key that the proxy has, too.")
@click.option("--name", default="", help="Take only a proxy that wants this name: proxy.name.")
@click.option("--sessions", type=click.IntRange(1), help="End after so many sessions.")
@click.option(
    "--silence",
    type=float,
    default=30.0,
    help="s without anything new after which a session is over.",
)
@click.option("--fault", metavar="WHAT@S", help=f"Fail so many s after the first step. {MEANINGS}.")
@json_option
def serve(
    fmu: Path,
    host: str,
    port: int,
    lockstep: bool,
    watchdog: float,
    failsafe: tuple[str, ...],
    key_file: Path | None,
    name: str,
    sessions: int | None,
    silence: float,
    fault: str | None,
    as_json: bool,
) -> int:
    """Serve FMU to a proxy, as a bench would, until interrupted.

    It runs in real time, or with --lockstep one step at a request: then a loop over the proxy gives
    the same values as one without. At the end it prints how much came. The exit code is 0, also
    after Ctrl-C, but 130 where that came before --sessions were served.

    \b
    Example: grasp-cosim serve fmus/build/GripperPlant.fmu --lockstep
    A failure rehearsed: grasp-cosim serve fmus/build/GripperPlant.fmu --fault mute@0.9
    """
    service = Service(
        lockstep,
        watchdog_ns=round(in_nanoseconds("--watchdog", watchdog)),
        failsafe=dict(pair("--failsafe", text, "INPUT=VALUE") for text in failsafe),
        key=None if key_file is None else shared_key(key_file, say),
        name=name,
        silence_ns=round(in_nanoseconds("--silence", silence)),
    )
    rehearsed = None if fault is None else Rehearsed.read(fault)
    served = ServedFmu(exchanged(fmu), service, say)
    with Server(served, (host, port), say, rehearsed) as server:
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


def _span(option: str, text: str) -> tuple[float, float]:
    """The shortest and the longest delay in s."""
    with suppress(ValueError):
        low, high = (2 * [float(part) for part in text.split(":", 1)])[:2]
        if not high < low:
            return low, high
    raise InputError(f"{option} {text!r}: must be S or FROM:TO, in s, the longer last")


CHANCES = ("loss", "duplicate", "reorder", "corrupt")


def _of_one_way(option: str, entries: str | None, both: Conditions) -> Conditions:
    """The conditions of one direction: those of both, but for what is given, like loss=0.1."""
    changed: dict[str, float] = {}
    for entry in entries.split(",") if entries else ():
        key, value = pair(
            option, entry, f"like loss=0.1,delay=0.001, of {', '.join(CHANCES)}, delay"
        )
        if key == "delay":
            low, high = _span(f"{option} delay", value)
            changed |= {"delay": low, "jitter": high - low}
        elif key in CHANCES:
            try:
                changed[key] = float(value)
            except ValueError as error:
                raise InputError(f"{option} {entry}: must be a probability, from 0 to 1") from error
        else:
            raise InputError(
                f"{option} {entry}: must be delay, {', '.join(CHANCES[:-1])} or corrupt"
            )
    return replace(both, **changed)


@click.command()
@click.argument("listen")
@click.argument("to")
@click.option(
    "--delay",
    default="0",
    metavar="S|FROM:TO",
    help="Time that a datagram takes in s; anything from one to the other, or always as long.",
)
@click.option("--loss", type=float, default=0.0, help="Probability that a datagram is lost.")
@click.option("--duplicate", type=float, default=0.0, help="Probability that it comes twice.")
@click.option("--reorder", type=float, default=0.0, help="Probability that it takes 20 ms more.")
@click.option("--corrupt", type=float, default=0.0, help="Probability that a bit of it changes.")
@click.option("--requests", metavar="KEY=VALUE,...", help="Other values for requests alone.")
@click.option("--answers", metavar="KEY=VALUE,...", help="Other values for answers alone.")
@click.option(
    "--outage",
    "outages",
    multiple=True,
    metavar="[requests:|answers:]FROM:[UNTIL]",
    help="Nothing gets through: numbers of requests, or s since the first as in 0.5s:2s.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    help="Another number has other datagrams lost, late or doubled.",
)
@click.option("--log", type=PATH, help="CSV to write with the fate of each datagram.")
@json_option
def relay(
    listen: str,
    to: str,
    delay: str,
    requests: str | None,
    answers: str | None,
    outages: tuple[str, ...],
    seed: int,
    log: Path | None,
    as_json: bool,
    **chances: float,
) -> int:
    """Relay UDP datagrams through a bad network, until Ctrl-C.

    They go from LISTEN to TO and back, both ways under the same conditions but for what --requests
    and --answers say of one. Each of the two is HOST:PORT, or PORT of this machine; LISTEN may be
    0, for one that is free. The n-th datagram of a direction has the same fate whenever the seed is
    the same. Counts are printed at the end.

    \b
    Example: grasp-cosim relay 5600 127.0.0.1:5501 --delay 0.001 --loss 0.01 --seed 1
    Half a link: grasp-cosim relay 5600 5501 --outage answers:0.9s: --requests loss=0.05
    """
    low, high = _span("--delay", delay)
    both = Conditions(low, high - low, **chances)
    conditions = {
        WORDS["requests"]: _of_one_way("--requests", requests, both),
        WORDS["answers"]: _of_one_way("--answers", answers, both),
    }
    network = Network(conditions, tuple(map(Outage.read, outages)), seed)
    host, port = read_address("LISTEN", listen)
    with (
        csv_log(log) as note,
        Relay(read_address("TO", to), network, host=host, port=port, log=note) as relay,
        interrupts(relay.stop),
    ):
        own_address, peer_address = text(relay.address), text(relay.peer)
        if not is_loopback(relay.address):
            reached = f"whoever reaches {own_address} reaches {peer_address}"
            say(f"listening beyond this machine: {reached}")
        say(f"relaying {own_address} -> {peer_address}")
        relay.run()
    show(as_json, relay.as_json(), relay.as_text())
    return 0
