"""A host that calls FMUs at random, to be run by any Python with tests/ on its path.

    python tests/fmus/random_calls.py FOLDER FIRST_SEED SEEDS CALLS FMU...

Each seed makes so many calls on each FMU, all of them in this one process: in any order, with wrong
references, numbers of any size and none, states of other instances and other FMUs, and bytes that
were changed. Prints a JSON object: the longest call in s of the processor and what it was, the
calls by their name and status, and the resident memory in bytes after each seed. Before each call
its name is written to FOLDER/last, so that one which ends the process is known.
"""

import ctypes
import gc
import json
import math
import os
import sys
import time
from collections import Counter, deque
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from random import Random
from typing import NamedTuple
from xml.etree import ElementTree

from support.fmi2 import OK, Fmu, Instance

INSTANCES = 2
"""Of each FMU, alive at a time; one of a proxy, whose peer has one session."""

KEPT = 6
"""States, and bytes of states, that are kept to be used again."""

SPECIAL = (0.0, -0.0, 1e-300, 5e-324, 1e-9, 1e-4, 1e-3, 0.1, 1.0, 10.0, 1e6, 1e300,
           sys.float_info.max, math.inf, math.nan)  # fmt: skip

WAITS = ("proxy.timeout", "proxy.connect_timeout")
"""Longest waits of a proxy, in s; they are as long as they are told to be."""

LEFT_ALONE = {*WAITS, "proxy.host", "proxy.port", "proxy.key_file", "proxy.on_loss"}
"""What may have a proxy ask the network for names, or read any file, or never begin."""

Limited = tuple[int, float, float]
"""A reference with the limits of its variable, nan where there are none."""


def variables(fmu):
    """Those of an FMU by the names of the functions that get and set them."""
    root = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()
    found = {}
    for v in root.findall("ModelVariables/*"):
        name, says = v.get("name", ""), v[0] if fmu.fmi == 2 else v
        if name in fmu.references and name not in LEFT_ALONE:  # and not the time of FMI 3.0
            low, high = (float(says.get(key, math.nan)) for key in ("min", "max"))
            found.setdefault(fmu.kinds[name], []).append((fmu.references[name], low, high))
    return found


class State(NamedTuple):
    """A state that an instance made, which must free it, and the time in it in s."""

    maker: "Caller"
    owner: Instance
    pointer: c_void_p
    time: float


class Caller:
    """Calls the functions of one FMU at random."""

    def __init__(self, fmu, random, folder, shared):
        self.fmu, self.random, self.shared = fmu, random, shared
        self.variables = variables(fmu)
        self.calls = Counter()
        self.longest = (0.0, "")
        self.last = (folder / "last").open("wb")
        self.bytes = deque(maxlen=KEPT)
        self.is_proxy = WAITS[0] in fmu.references
        self.instances = [self.made() for _ in range(1 if self.is_proxy else INSTANCES)]
        self.times = [0.0] * len(self.instances)

    def run(self, calls):
        """Make so many calls."""
        for _ in range(calls):
            self.at = self.random.randrange(len(self.instances))
            self.instance = self.instances[self.at]
            self.instance.log.clear()
            self.random.choice(ACTIONS)(self)

    def end(self):
        """Free all that there is."""
        for state in [s for s in self.shared if s.maker is self]:
            self.free(state)
        for instance in self.instances:
            self.call("FreeInstance", on=instance)
        self.last.close()

    def made(self):
        instance = Instance(self.fmu, "any")
        if self.is_proxy:
            assert instance.set(dict.fromkeys(WAITS, 0.1)) == OK
        return instance

    def call(self, name, *arguments, on=None):
        said = f"{self.fmu.name} {name} {arguments}"[:200]
        os.pwrite(self.last.fileno(), f"{said:200}\n".encode(), 0)  # to truncate it takes longer
        began = time.thread_time()
        status = (on or self.instance).call(name, *arguments)
        took = time.thread_time() - began
        self.longest = max(self.longest, (took, f"{self.fmu.name} {name} {arguments}"))
        self.calls[f"{name} {status if name != 'FreeInstance' else ''}"] += 1
        return status

    # What the arguments are

    def number(self):
        r = self.random
        sign = r.choice((1.0, -1.0))
        powers = 10.0 ** r.uniform(-300.0, 300.0)
        return sign * float(r.choice((r.choice(SPECIAL), r.uniform(0.0, 1.0), powers)))

    def value(self, low, high):
        """One that a variable with these limits may have, often at its limits."""
        r = self.random
        if not low < high or r.random() < 0.1:
            return self.number()
        far = r.choice((0.0, 10.0 ** r.uniform(-9.0, 0.0))) * (high - low)
        return float(r.choice((low + far, high - far)))

    def drawn(self, kind):
        """References of a type, mostly; some of another, and some that there are none of."""
        r, found = self.random, []
        for _ in range(r.choice((0, 1, 1, 1, 2, 5))):
            wrong = r.choice((r.randrange(200), r.randrange(2**32), 2**32 - 1, 2**31))
            own = self.variables.get(kind, [])
            found.append(r.choice(own) if own and r.random() < 0.9 else (wrong, math.nan, math.nan))
        if self.is_proxy:  # a wrong one may be that of what is left alone
            found = [v for v in found if v[0] >= 2**31 or v in self.variables.get(kind, [])]
        n = len(found)
        return (c_uint * n)(*(v[0] for v in found)), c_size_t(n), found

    # What is called

    def set_up(self):
        start = self.number() if self.random.random() < 0.3 else 0.0
        any_ = c_double(self.number())
        if self.call("SetupExperiment", 1, any_, c_double(start), 1, any_) == OK:
            self.times[self.at] = start

    def start(self):
        """In order, so that there are instances that step."""
        if self.call("Reset") == OK:
            self.times[self.at] = 0.0
        if self.is_proxy:
            assert self.instance.set(dict.fromkeys(WAITS, 0.1)) == OK
        for _ in range(self.random.choice((0, 0, 1, 3))):
            self.set("Real")
            self.set("Boolean")
        self.call("SetupExperiment", 0, c_double(0.0), c_double(0.0), 0, c_double(0.0))
        self.call("EnterInitializationMode")
        self.call("ExitInitializationMode")

    def anew(self):
        if self.random.random() < 0.1:
            for state in [s for s in self.shared if s.owner is self.instance]:
                self.free(state)
            self.call("FreeInstance")
            self.instances[self.at], self.times[self.at] = self.made(), 0.0

    def step(self):
        size = self.random.choice((1e-4, 1e-3, 1e-2, 0.1, abs(self.number()), self.number()))
        begin = self.times[self.at] if self.random.random() < 0.9 else self.number()
        if self.call("DoStep", c_double(begin), c_double(size), 1) == OK:
            self.times[self.at] = begin + size

    def set(self, kind):
        vector, n, chosen = self.drawn(kind)
        if kind == "Real":
            values = (c_double * n.value)(*(self.value(low, high) for _, low, high in chosen))
        elif kind == "String":
            values = (c_char_p * n.value)(*(self.random.randbytes(9) * 40 for _ in chosen))
        else:
            whole = (0, 1, 2, -1, 2**31 - 1, -(2**31))
            values = (c_int * n.value)(*(self.random.choice(whole) for _ in chosen))
        self.call(f"Set{kind}", vector, n, values)

    def get(self):
        kind = self.random.choice(("Real", "Real", "Integer", "Boolean", "String"))
        element = {"Real": c_double, "String": c_char_p}.get(kind, c_int)
        vector, n, _ = self.drawn(kind)
        self.call(f"Get{kind}", vector, n, (element * n.value)())

    def keep(self, function, *arguments):
        """Keep the state that it makes; the oldest goes, freed by the instance that made it."""
        pointer = c_void_p()
        if self.call(function, *arguments, byref(pointer)) == OK:
            self.shared.append(State(self, self.instance, pointer, self.times[self.at]))
            own = [s for s in self.shared if s.maker is self]
            if len(own) > KEPT:
                self.free(own[0])

    def free(self, state):
        self.shared.remove(state)
        self.call("FreeFMUstate", byref(state.pointer), on=state.owner)

    def restore(self):
        if self.shared:
            state = self.random.choice(self.shared)
            if self.call("SetFMUstate", state.pointer) == OK:
                self.times[self.at] = state.time

    def serialise(self):
        if self.shared:
            pointer, size = self.random.choice(self.shared).pointer, c_size_t()
            if self.call("SerializedFMUstateSize", pointer, byref(size)) == OK:
                buffer = (ctypes.c_char * size.value)()
                if self.call("SerializeFMUstate", pointer, buffer, size) == OK:
                    self.bytes.append(buffer.raw)

    def deserialise(self):
        """From bytes that are as they were, cut, longer, or with another number in them."""
        r = self.random
        data = bytearray(r.choice(self.bytes) if self.bytes else r.randbytes(r.choice((0, 7, 300))))
        for _ in range(r.choice((0, 1, 1, 5))):
            place, change = r.randrange(len(data) + 1), r.randrange(3)
            if change == 0:
                data[place:] = r.randbytes(r.choice((0, 8)))
            elif change == 1:
                data[place : place + 1] = r.randbytes(1)
            elif len(data) >= 32:
                place = 24 + 8 * r.randrange((len(data) - 24) // 8)
                data[place : place + 8] = bytes(c_double(self.number()))
        buffer = (ctypes.c_char * max(1, len(data))).from_buffer_copy(bytes(data) or b"\0")
        self.keep("DeSerializeFMUstate", buffer, c_size_t(len(data)))

    def other(self):
        """What a slave of ours does not have, and switches."""
        vector, n, _ = self.drawn("Real")
        numbers = (c_double * n.value)()
        if self.random.random() < 0.5:
            self.call("SetDebugLogging", self.random.randrange(2), c_size_t(0), None)
        else:
            self.call("GetDirectionalDerivative", vector, n, vector, n, numbers, numbers)


def seldom(call):
    return lambda caller: caller.random.random() < 0.2 and call(caller)


ACTIONS = (
    Caller.set_up, Caller.start, Caller.anew, Caller.get, Caller.get, Caller.other,
    *(Caller.step,) * 6,
    *(lambda c: c.set("Real"),) * 4,
    lambda c: c.set(c.random.choice(("Integer", "Boolean", "String"))),
    lambda c: c.call("EnterInitializationMode"), lambda c: c.call("ExitInitializationMode"),
    seldom(lambda c: c.call("Terminate")),
    lambda c: c.keep("GetFMUstate"), Caller.restore, Caller.restore, Caller.serialise,
    Caller.deserialise, Caller.deserialise,
)  # fmt: skip


def main(folder, first, seeds, calls, *fmus):
    loaded = [Fmu(Path(fmu), Path(folder, Path(fmu).stem)) for fmu in fmus]
    longest, done, memory = (0.0, ""), Counter[str](), []
    for seed in range(int(first), int(first) + int(seeds)):
        shared = []
        callers = [
            Caller(fmu, Random(f"{seed} {fmu.name}"), Path(folder), shared) for fmu in loaded
        ]
        for _ in range(4):  # by turns, so that there are states of others
            for caller in callers:
                caller.run(int(calls) // 4)
        for caller in callers:
            caller.end()
            done += caller.calls
            longest = max(longest, caller.longest)
        gc.collect()
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        memory.append(pages * os.sysconf("SC_PAGESIZE"))
    print(json.dumps({"longest": longest, "calls": done, "memory": memory}))  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
