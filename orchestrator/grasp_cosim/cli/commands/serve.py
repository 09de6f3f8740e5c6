"""The command serve."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from ...errors import InputError
from ...hil.address import is_loopback, text
from ...hil.protocol import LONGEST_SILENCE, exchanged, shared_key
from ...hil.served import ServedFmu, Service
from ...hil.server import DEFAULT_ADDRESS, Server
from ...interruption import interrupts
from ...system.parts import in_nanoseconds
from ..frame import FAILED, INTERRUPTED, NEGATIVE, PATH, fail, json_option, pair, say, show

PATIENCE = 2.0
"""s that a call of the FMU may go on after --duration."""


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
@click.option("--step", type=float, help="Own step in s; default: that of the proxy.")
@click.option(
    "--watchdog", type=float, default=0.1, show_default=True, help="Longest silence in s."
)
@click.option(
    "--failsafe",
    multiple=True,
    metavar="INPUT=VALUE",
    help="Of an input after a silence; default: its start value.",
)
@click.option("--key-file", type=PATH, help="A key shared with the proxy.")
@click.option("--sessions", type=click.IntRange(1), help="End after so many sessions.")
@click.option("--duration", type=float, help="End after so many s.")
@json_option
def serve(
    fmu: Path,
    host: str,
    port: int,
    lockstep: bool,
    step: float | None,
    watchdog: float,
    failsafe: tuple[str, ...],
    key_file: Path | None,
    sessions: int | None,
    duration: float | None,
    as_json: bool,
) -> int:
    """Serve FMU to a proxy, as a bench would, until interrupted.

    It runs in real time, or with --lockstep one step at a request: then a loop over the proxy gives
    the same values as one without. What came is counted, and said
    in the end. Exit code 1: --duration was over before --sessions; 130 or 143: cut short.

    \b
    Example: grasp-cosim serve fmus/build/GripperPlant.fmu --lockstep
    """
    if lockstep and step is not None:
        raise InputError(f"--step {step!r}: must be left out with --lockstep, the proxy decides")
    service = Service(
        lockstep,
        None if step is None else in_nanoseconds("--step", step),
        in_nanoseconds("--watchdog", watchdog),
        dict(pair("--failsafe", text, "INPUT=VALUE") for text in failsafe),
        None if key_file is None else shared_key(key_file, say),
    )
    end = None if duration is None else in_nanoseconds("--duration", duration)
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
        with interrupts(server.stop) as came, _ended_after(duration, fmu.name):
            server.serve(sessions, end)
        counters = served.counters()
    came_in = ", ".join(f"{name} {count}" for name, count in counters.items() if count)
    show(as_json, {"listening": at, **counters}, came_in or "nothing came")
    if came.is_set() and (sessions or duration):
        return fail("interrupted before --sessions or --duration ended it", INTERRUPTED)
    if sessions and counters["sessions"] < sessions:
        return fail(f"{counters['sessions']} of {sessions} sessions in {duration!r} s", NEGATIVE)
    return 0


@contextmanager
def _ended_after(duration: float | None, name: str) -> Iterator[None]:
    """End the process where the FMU hangs in a call when --duration, in s, is over."""

    def give_up() -> None:
        fail(f"{name} has not returned from a call {PATIENCE:g} s after --duration", FAILED)
        os._exit(FAILED)

    if duration is None:
        yield
        return
    timer = threading.Timer(duration + PATIENCE, give_up)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
