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
@click.option(
    "--host", metavar="ADDRESS", default=DEFAULT_ADDRESS[0], help="Network address to listen on."
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=DEFAULT_ADDRESS[1],
    help="UDP port to listen on. 0 takes a free port.",
)
@click.option("--lockstep", is_flag=True, help="Step on request, not by the clock.")
@click.option(
    "--watchdog",
    type=float,
    default=0.1,
    help="Time in s without a request that confirms a new answer. After it the "
    "inputs get their safe values.",
)
@click.option(
    "--failsafe",
    multiple=True,
    metavar="INPUT=VALUE",
    help="Safe value of an input. Default: the start value.",
)
@click.option("--key-file", type=PATH, help="File with the key that the proxy has, too.")
@click.option(
    "--name", default="", help="Accept only proxies whose parameter proxy.name has this value."
)
@click.option("--sessions", type=click.IntRange(1), help="End after so many link sessions.")
@click.option(
    "--silence",
    type=float,
    default=30.0,
    help="Time in s without a new request, after which a link session ends.",
)
@click.option(
    "--fault",
    metavar="FAILURE@SECONDS",
    help=f"Rehearse a failure at a time after the first step. {MEANINGS}.",
)
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
    """Serve an FMU to a proxy, in the place of a test bench.

    The command simulates FMU in real time and answers the requests of a proxy over UDP. With
    --lockstep it makes one step per request. A closed loop then gives the same values as without a
    proxy.

    The command runs until Ctrl-C. At the end it prints the numbers of link sessions, steps,
    requests and failures. The exit code is 130 if Ctrl-C arrives before the --sessions have ended,
    else 0.

    \b
    Example: grasp-cosim serve fmus/build/GripperPlant.fmu --lockstep
    Rehearse a failure: grasp-cosim serve plant.fmu --fault mute@0.9
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
    metavar="SECONDS|FROM:TO",
    help="Delay of each datagram in s, constant or random in a range.",
)
@click.option("--loss", type=float, default=0.0, help="Probability of a lost datagram.")
@click.option("--duplicate", type=float, default=0.0, help="Probability of a second copy.")
@click.option("--reorder", type=float, default=0.0, help="Probability of 20 ms more delay.")
@click.option("--corrupt", type=float, default=0.0, help="Probability of a wrong bit.")
@click.option(
    "--requests",
    metavar="OPTION=VALUE,...",
    help="Values of these options only for requests, such as loss=0.05,delay=0.002.",
)
@click.option("--answers", metavar="OPTION=VALUE,...", help="The same only for answers.")
@click.option(
    "--outage",
    "outages",
    multiple=True,
    metavar="FROM:UNTIL",
    help="Drop all datagrams in a range of numbers of requests, or of times since the first one: "
    "0.5s:2s. Without UNTIL the outage does not end. A prefix requests: or answers: selects a "
    "direction.",
)
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=0,
    help="Seed of the random numbers. The same seed gives the same losses and delays.",
)
@click.option("--log", type=PATH, help="CSV file to write, with a row for each datagram.")
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
    """Relay UDP datagrams like a bad network.

    The command receives requests at LISTEN, sends them to TO, and sends the answers back. LISTEN
    and TO are ADDRESS:PORT, or PORT of this machine. If LISTEN is 0, the command takes a free port.

    Both directions have the same conditions, except the values in --requests and --answers. The
    command runs until Ctrl-C. At the end it prints the numbers of datagrams.

    \b
    Example: grasp-cosim relay 5600 127.0.0.1:5501 --delay 0.001 --loss 0.01
    Lose the answers: grasp-cosim relay 5600 5501 --outage answers:0.9s:
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
