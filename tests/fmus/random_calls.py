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
from hashlib import blake2b
from pathlib import Path
from random import Random
from typing import Any, NamedTuple
from xml.etree import ElementTree

from support.fmi2 import OK, Fmu, Instance

INSTANCES = 2
"""Of each FMU, alive at a time; one of a proxy, whose peer has one session."""

KEPT = 6
"""States, and bytes of states, that are kept to be used again."""

PAGE = os.sysconf("SC_PAGESIZE")

SPECIAL = (
    0.0, -0.0, 1e-300, 5e-324, 1e-9, 1e-4, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e6, 1e9, 1e300,
    sys.float_info.max, math.inf, math.nan,
)  # fmt: skip

WAITS = ("proxy.timeout", "proxy.connect_timeout")
"""Longest waits of a proxy, in s; they are as long as they are told to be."""

LEFT_ALONE = (*WAITS, "proxy.host", "proxy.port", "proxy.key_file", "proxy.on_loss")
"""What may have a proxy ask the network for names, or read any file, or never begin."""


class Variables:
    """The variables of an FMU by their FMI type, with the limits that they are declared with."""

    def __init__(self, fmu: Fmu) -> None:
        root = ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()
        self.by_type: dict[str, list[tuple[int, float, float]]] = {}
        self.left_alone: set[int] = set()
        for v in root.findall("ModelVariables/*"):
            name, declared = v.get("name", ""), v[0] if fmu.fmi == 2 else v
            if name not in fmu.references:  # the time of FMI 3.0
                continue
            low, high = (float(declared.get(k, math.nan)) for k in ("min", "max"))
            known = self.by_type.setdefault(fmu.kinds[name], [])
            known.append((fmu.references[name], low, high))
            if name in LEFT_ALONE:
                self.left_alone.add(fmu.references[name])


class State(NamedTuple):
    """A state that an instance made, which must free it, and the time in it in s."""

    maker: "Caller"
    owner: Instance
    pointer: c_void_p
    time: float


class Caller:
    """Calls the functions of one FMU at random."""

    def __init__(self, fmu: Fmu, random: Random, folder: Path, shared: list[State]) -> None:
        self.fmu, self.random = fmu, random
        self.variables = Variables(fmu)
        self.calls: Counter[str] = Counter()
        self.longest = (0.0, "")
        self._last = (folder / "last").open("w")
        self._shared = shared  # those of all FMUs
        self._bytes: deque[bytes] = deque(maxlen=KEPT)
        self._is_proxy = WAITS[0] in fmu.references
        self._instances = [self._made() for _ in range(1 if self._is_proxy else INSTANCES)]
        self._times = [0.0] * len(self._instances)

    def run(self, calls: int) -> None:
        """Make so many calls."""
        for _ in range(calls):
            self._at = self.random.randrange(len(self._instances))
            self._instance = self._instances[self._at]
            self._instance.log.clear()
            getattr(self, self.random.choice(ACTIONS))()

    def end(self) -> None:
        """Free all that there is."""
        for state in [s for s in self._shared if s.maker is self]:
            self._free(state)
        for instance in self._instances:
            self._call("FreeInstance", on=instance)
        self._last.close()

    def _made(self) -> Instance:
        instance = Instance(self.fmu, "any", self.random.random() < 0.3)
        self._be_quick(instance)
        return instance

    def _be_quick(self, instance: Instance) -> None:
        """Have a proxy wait for 0.1 s at most, and outlive its peer at times."""
        if not self._is_proxy:
            return
        assert instance.set(dict.fromkeys(WAITS, 0.1)) == OK
        choice = (c_char_p * 1)(self.random.choice((b"stop", b"hold", b"failsafe")))
        reference = (c_uint * 1)(self.fmu.references["proxy.on_loss"])
        assert instance.call("SetString", reference, c_size_t(1), choice) == OK

    def _call(self, name: str, *arguments: Any, on: Instance | None = None) -> int:
        self._last.seek(0)
        self._last.write(f"{self.fmu.name} {name} {arguments}\n")
        self._last.truncate()
        self._last.flush()
        began = time.thread_time()
        status = (on or self._instance).call(name, *arguments)
        took = time.thread_time() - began
        if took > self.longest[0]:
            self.longest = (took, f"{self.fmu.name} {name} {[str(a) for a in arguments]}")
        self.calls[f"{name} {status if name != 'FreeInstance' else ''}"] += 1
        return status

    # What the arguments are

    def _number(self) -> float:
        r = self.random
        kind = r.random()
        if kind < 0.4:
            return r.choice((1.0, -1.0)) * r.choice(SPECIAL)
        if kind < 0.7:
            return float(r.choice((1.0, -1.0)) * 10.0 ** r.uniform(-300.0, 300.0))
        return r.uniform(-1.0, 1.0)

    def _in_range(self, low: float, high: float) -> float:
        """A value that a variable with these limits may have, often at its limits."""
        r = self.random
        if not low < high or r.random() < 0.1:
            return self._number()
        if r.random() < 0.3:
            return r.choice((low, high))
        span: float = 10.0 ** r.uniform(-9.0, 0.0) * (high - low)
        return low + span if r.random() < 0.5 else high - span

    def _references(self, kind: str) -> list[tuple[int, float, float]]:
        """Variables of a type, mostly; some of another, and some that there are none of."""
        r = self.random
        own = self.variables.by_type.get(kind, [])
        found = []
        for _ in range(r.choice((0, 1, 1, 1, 2, 5))):
            if own and r.random() < 0.9:
                found.append(r.choice(own))
            else:
                wrong = r.choice((r.randrange(200), r.randrange(2**32), 2**32 - 1, 2**31))
                found.append((wrong, math.nan, math.nan))
        return found

    def _vector(self, references: list[tuple[int, float, float]]) -> tuple[Any, Any]:
        n = len(references)
        return (c_uint * n)(*(reference for reference, *_ in references)), c_size_t(n)

    # What is called

    def _setup(self) -> None:
        start = self._number() if self.random.random() < 0.3 else 0.0
        on, number = self.random.randrange(2), self._number()
        status = self._call(
            "SetupExperiment", on, c_double(number), c_double(start), on, c_double(number)
        )
        if status == OK:
            self._times[self._at] = start

    def _enter(self) -> None:
        self._call("EnterInitializationMode")

    def _exit(self) -> None:
        self._call("ExitInitializationMode")

    def _start(self) -> None:
        """In order, so that there are instances that step."""
        if self._call("Reset") == OK:
            self._times[self._at] = 0.0
        self._be_quick(self._instance)
        for _ in range(self.random.choice((0, 0, 1, 3))):
            self._set("Real")
            self._set("Boolean")
        self._call("SetupExperiment", 0, c_double(0.0), c_double(0.0), 0, c_double(0.0))
        self._enter()
        self._exit()

    def _seldom_end(self) -> None:
        if self.random.random() < 0.2:
            self._call("Terminate")

    def _seldom_anew(self) -> None:
        if self.random.random() < 0.1:
            for state in [s for s in self._shared if s.owner is self._instance]:
                self._free(state)
            self._call("FreeInstance")
            self._instances[self._at] = self._made()
            self._times[self._at] = 0.0

    def _step(self) -> None:
        size = self.random.choice((1e-4, 1e-3, 1e-2, 0.1, abs(self._number()), self._number()))
        begin = self._times[self._at] if self.random.random() < 0.9 else self._number()
        if self._call("DoStep", c_double(begin), c_double(size), self.random.randrange(2)) == OK:
            self._times[self._at] = begin + size

    def _set(self, kind: str) -> None:
        r = self.random
        chosen = [v for v in self._references(kind) if v[0] not in self.variables.left_alone]
        vector, n = self._vector(chosen)
        values: Any
        if kind == "Real":
            values = (c_double * n.value)(*(self._in_range(low, high) for _, low, high in chosen))
        elif kind == "String":
            texts = (
                bytes(r.randrange(1, 256) for _ in range(r.choice((0, 3, 300)))) for _ in chosen
            )
            values = (c_char_p * n.value)(*texts)
        else:
            values = (c_int * n.value)(
                *(r.choice((0, 1, 2, -1, 2**31 - 1, -(2**31))) for _ in chosen)
            )
        self._call(f"Set{kind}", vector, n, values)

    def _set_real(self) -> None:
        self._set("Real")

    def _set_other(self) -> None:
        self._set(self.random.choice(("Integer", "Boolean", "String")))

    def _get(self) -> None:
        kind = self.random.choice(("Real", "Real", "Integer", "Boolean", "String"))
        element = {"Real": c_double, "String": c_char_p}.get(kind, c_int)
        vector, n = self._vector(self._references(kind))
        self._call(f"Get{kind}", vector, n, (element * n.value)())

    def _save(self) -> None:
        pointer = c_void_p()
        if self._call("GetFMUstate", byref(pointer)) == OK:
            self._keep(pointer)

    def _keep(self, pointer: c_void_p) -> None:
        """Keep a state; the oldest goes, freed by the instance that made it."""
        self._shared.append(State(self, self._instance, pointer, self._times[self._at]))
        own = [s for s in self._shared if s.maker is self]
        if len(own) > KEPT:
            self._free(own[0])

    def _free(self, state: State) -> None:
        self._shared.remove(state)
        self._call("FreeFMUstate", byref(state.pointer), on=state.owner)

    def _restore(self) -> None:
        if self._shared:
            state = self.random.choice(self._shared)
            if self._call("SetFMUstate", state.pointer) == OK:
                self._times[self._at] = state.time

    def _serialise(self) -> None:
        if not self._shared:
            return
        pointer, size = self.random.choice(self._shared).pointer, c_size_t()
        if self._call("SerializedFMUstateSize", pointer, byref(size)) == OK:
            buffer = (ctypes.c_char * size.value)()
            if self._call("SerializeFMUstate", pointer, buffer, size) == OK:
                self._bytes.append(buffer.raw)

    def _deserialise(self) -> None:
        r = self.random
        data = bytearray(
            r.choice(self._bytes) if self._bytes else r.randbytes(r.choice((0, 7, 300)))
        )
        for _ in range(r.choice((0, 1, 1, 5))):
            place = r.randrange(len(data) + 1)
            change = r.randrange(4)
            if change == 0:
                data[place:] = b""
            elif change == 1:
                data[place:place] = r.randbytes(8)
            elif change == 2:
                data[place : place + 1] = r.randbytes(1)
            elif len(data) >= 48:  # a number of the state, with the check sum that it needs
                at = 40 + 8 * r.randrange((len(data) - 40) // 8)
                data[at : at + 8] = bytes(c_double(self._number()))
                data[24:40] = blake2b(bytes(data[8:24] + data[40:]), digest_size=16).digest()
        buffer = (ctypes.c_char * max(1, len(data))).from_buffer_copy(bytes(data) or b"\0")
        pointer = c_void_p()
        if self._call("DeSerializeFMUstate", buffer, c_size_t(len(data)), byref(pointer)) == OK:
            self._keep(pointer)

    def _other(self) -> None:
        """What a slave of ours does not have, and switches."""
        r = self.random
        vector, n = self._vector(self._references("Real"))
        numbers = (c_double * n.value)()
        orders = (c_int * n.value)()
        which = r.randrange(6 if self.fmu.fmi == 2 else 2)  # FMI 3.0 has none of the others
        if which == 0:
            self._call("SetDebugLogging", r.randrange(2), c_size_t(0), None)
        elif which == 1:
            self._call("GetDirectionalDerivative", vector, n, vector, n, numbers, numbers)
        elif which == 2:
            self._call("SetRealInputDerivatives", vector, n, orders, numbers)
        elif which == 3:
            self._call("GetRealOutputDerivatives", vector, n, orders, numbers)
        elif which == 4:
            self._call("CancelStep")
        else:
            kind, value = r.choice((("Real", c_double), ("Integer", c_int), ("Boolean", c_int)))
            self._call(f"Get{kind}Status", r.randrange(-1, 9), byref(value()))


ACTIONS = (
    *("_setup", "_enter", "_exit", "_start", "_seldom_end", "_seldom_anew"),
    *("_step",) * 6,
    *("_set_real",) * 4,
    *("_set_other", "_get", "_get", "_other"),
    *("_save", "_restore", "_restore", "_serialise", "_deserialise", "_deserialise"),
)


def resident() -> int:
    """Bytes of memory that this process has."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def main(folder: str, first: str, seeds: str, calls: str, *fmus: str) -> None:
    loaded = [Fmu(Path(fmu), Path(folder, Path(fmu).stem)) for fmu in fmus]
    longest, done, memory = (0.0, ""), Counter[str](), []
    for seed in range(int(first), int(first) + int(seeds)):
        shared: list[State] = []
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
        memory.append(resident())
    print(json.dumps({"longest": longest, "calls": done, "memory": memory}))  # noqa: T201


if __name__ == "__main__":
    main(*sys.argv[1:])
