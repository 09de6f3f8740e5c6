"""Measure and calibrate the controller on its target by XCP while it runs, with pyXCP.

    python docs/calibrate.py controller_c/GraspController.a2l --set simultaneous_contact.gain=6

It measures six signals at each step and writes them to measured.csv. After a second it sets the
parameter. It ends when no more steps come. docs/how_to/calibrate.md has the whole session.
"""

import argparse
import csv
import json
import struct
import subprocess
import sys
import time
from pathlib import Path

from pyxcp.config import create_application_from_config
from pyxcp.cpp_ext.cpp_ext import DaqList
from pyxcp.daq_stim import DaqOnlinePolicy
from pyxcp.master.master import Master

SIGNALS = (
    "force[1]",
    "force[2]",
    "intensity[1]",
    "intensity[2]",
    "simultaneous_contact_force",
    "simultaneous_contact.gain",
)


def addresses_of(a2l: Path) -> dict[str, int]:
    """Return the addresses of all parameters and measured values by name, as pya2l reads them."""
    command = [str(Path(sys.executable).with_name("pya2l")), str(a2l), "to_json"]
    said = subprocess.run(command, capture_output=True, check=True).stdout  # noqa: S603
    [module] = json.loads(said)["PROJECT"]["MODULE"]
    places = {c["Name"]["Value"]: c["Address"] for c in module["CHARACTERISTIC"]}
    places |= {m["Name"]["Value"]: m["ECU_ADDRESS"]["Address"] for m in module["MEASUREMENT"]}
    return {name: int(address["Value"]) for name, address in places.items()}


PATIENCE = 60.0
"""s of the clock until the step at which the parameter is set."""


class Rows(DaqOnlinePolicy):
    """Keeps the rows that come: the time in us, then a value for each signal."""

    def initialize(self) -> None:
        """Begin without rows; pyXCP has its own order of the signals."""
        self.rows: list[list[float]] = []
        self.names = [name for name, _ in self.daq_lists[0].headers]

    def on_daq_list(self, daq_list: int, start: int, stamp: int, payload: list[float]) -> None:
        """Keep a row; the stamp is in ns."""
        self.rows.append([stamp // 1000, *payload])


def main() -> None:
    """Run the session."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("a2l", type=Path)
    parser.add_argument("--port", type=int, default=5555)
    parser.add_argument("--set", default="simultaneous_contact.gain=6", metavar="NAME=VALUE")
    parser.add_argument("--after", type=float, default=1.0, help="s of the loop's time")
    parser.add_argument("-o", "--out", type=Path, default=Path("measured.csv"))
    options = parser.parse_args()
    places = addresses_of(options.a2l)
    name, _, value = options.set.partition("=")
    measured = [(signal, places[signal], 0, "F64") for signal in SIGNALS]
    policy = Rows([DaqList("step", 0, False, True, measured, 0, 1)])
    transport = {"host": "127.0.0.1", "port": options.port, "protocol": "UDP"}
    config = {"Transport": {"layer": "ETH", "Eth": transport}}
    with Master("eth", create_application_from_config(config), policy) as xcp:
        xcp.connect()
        print("connected to", xcp.identifier(1))
        policy.setup()
        policy.start()  # type: ignore[no-untyped-call]
        print("measuring", ", ".join(policy.names), flush=True)
        deadline = time.monotonic() + PATIENCE
        while not policy.rows or policy.rows[-1][0] < options.after * 1e6:
            if time.monotonic() > deadline:
                raise SystemExit(f"no step at {options.after:g} s in {PATIENCE:g} s")
            time.sleep(0.01)
        xcp.setMta(places[name])
        xcp.download(struct.pack("<d", float(value)))
        [found] = struct.unpack("<d", xcp.shortUpload(8, places[name]))
        print(f"set {name} to {found}")
        seen = 0
        while len(policy.rows) > seen:
            seen = len(policy.rows)
            time.sleep(0.5)
        policy.stop()  # type: ignore[no-untyped-call]
        xcp.disconnect()
    with options.out.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["time in us", *policy.names])
        table.writerows(policy.rows)
    print(f"measured {len(policy.rows)} steps")


if __name__ == "__main__":
    main()
