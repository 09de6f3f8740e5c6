"""Components without any binary, input u, output y, tunable p, which do what they are told.

And a group of metrics that is registered for a test.
"""

import zipfile
from collections.abc import Callable

from grasp_cosim import SimulationError, System
from grasp_cosim.base import registry
from grasp_cosim.base.calls import Call
from grasp_cosim.exchange.dispatch import Dispatcher
from grasp_cosim.fmi.instance import DISCARD
from grasp_cosim.interface.read import read_interface
from grasp_cosim.master.master import Master
from grasp_cosim.metrics.groups import Group
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.system.parts import Component

Function = Callable[[float, float], float]

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{name}">
  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="{vary}"/>
  <VendorAnnotations>{annotation}</VendorAnnotations>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input" variability="{variability}">
      <{kind} start="{zero}"{nominal}/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" variability="{variability}">
      <{kind}/></ScalarVariable>
    <ScalarVariable name="p" valueReference="2" causality="parameter" variability="tunable">
      <Real start="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2"{depends}/></Outputs>
    <InitialUnknowns><Unknown index="2"{initially}/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


INFINITE_U = '<Tool name="grasp-cosim"><Infinite variable="u"/></Tool>'


class Mock:
    """y = output(u, time), where time only moves with a step.

    direct says whether y is declared to depend on u, initially the same at the start where that
    differs, infinite that u takes inf, nominal is that of u. rejects, if given, is asked at each
    step for the time reached: the step is discarded where that is before its end.
    """

    def __init__(
        self, folder, name, output, kind="Real", direct=True, vary=True, nominal=None, rejects=None,
        initially=None, infinite=False,
    ):  # fmt: skip
        self.name = name
        self.output = output
        self.rejects = rejects
        self.u = {"Integer": 0, "Boolean": False, "String": ""}.get(kind, 0.0)
        self.p = 1.0
        self.time = 0.0
        self.ended = None
        self.calls = []
        self.statuses = {"send": 0, "step": 0, "receive": 0}
        self.path = folder / f"{name}.fmu"
        declared = {True: ' dependencies="1"', False: ' dependencies=""', None: ""}
        text = DESCRIPTION.format(
            name=name, kind=kind, depends=declared[direct], vary=str(vary).lower(),
            initially=declared[direct if initially is None else initially],
            variability="continuous" if kind == "Real" else "discrete",
            nominal="" if nominal is None else f' nominal="{nominal}"',
            annotation=INFINITE_U if infinite else "",
            zero={"Boolean": "false", "String": ""}.get(kind, "0"),
        )  # fmt: skip
        with zipfile.ZipFile(self.path, "w") as archive:
            archive.writestr("modelDescription.xml", text)

    @property
    def interface(self):
        return read_interface(self.path)

    def enter_initialization(self, values, stop, start=0.0):
        self.calls.append("enter")
        self.u = values.get("u", self.u)

    def exit_initialization(self):
        self.calls.append("exit")

    def get(self, variables):
        self.calls.append("receive")
        if self.statuses["receive"] > 1:
            raise self.failure(self.statuses["receive"], self.time)
        values = {"u": self.u, "p": self.p, "y": self.output(self.u, self.time)}
        return [values[v.name] for v in variables]

    def set(self, variables, values):
        self.calls.append("send")
        for v, value in zip(variables, values, strict=True):
            setattr(self, v.name, value if v.kind == "String" else float(value))

    def transfer(self, action, variables, data):
        def send():
            self.calls.append("send")
            self.u = float(data[0])
            return self.statuses["send"]

        def receive():
            self.calls.append("receive")
            data[0] = self.output(self.u, self.time)
            return self.statuses["receive"]

        return Call(send if action == "set" else receive)

    def stepper(self, clock, step):
        def advance():
            begin = float(clock[0])
            self.calls.append(f"step {begin!r} {step!r}")
            self.time = begin + step
            if self.rejects and (reached := self.rejects(begin, begin + step)) < begin + step:
                self.time = reached
                return DISCARD
            return self.statuses["step"]

        return Call(advance)

    def last_successful_time(self):
        return self.time

    def the_end(self):
        return self.ended

    def failure(self, status, time):
        return SimulationError(f"{self.name}: status {status} at {time!r}")

    def remarks(self, returned=0, first=0.0):
        return [f"{self.name}: {returned} warnings since {first!r}"] if returned else []

    def quieten(self):
        pass

    def close(self):
        self.calls.append("close")


def make_system(mocks, connections, steps=4, step_ns=100_000_000, **more):
    """A system of mocks; more are other fields of System, and `own`: steps by name.

    An input without a connection is given what the mock has there.
    """
    own = more.pop("own", {})
    connected = {connection.target.component for connection in connections}
    components = tuple(
        Component(
            m.name, m.path, {} if m.name in connected else {"u": m.u}, step_ns=own.get(m.name)
        )
        for m in mocks
    )
    more.setdefault("scheme", "sequential")
    return System("mock.toml", components, tuple(connections), step_ns, step_ns * steps, **more)


class Run:
    """A master over mocks and what it recorded."""

    def __init__(self, system, mocks, engine="python"):
        self.memory = MemoryListener()
        self.master = Master(system, mocks, lambda *rows: self.dispatch(*rows), engine)
        self.dispatch = Dispatcher(
            system, self.master.slots, [self.memory], texts=self.master.texts
        )

    def to_the_end(self):
        self.master.initialise()
        self.master.advance(self.master.total_steps)
        return self.signals()

    def signals(self):
        return {name: column.tolist() for name, column in self.memory.columns()[1].items()}


def bring_group(monkeypatch, name, *metrics):
    monkeypatch.setitem(registry._OBJECTS, ("groups", name), Group(metrics))
