"""A system that is no grasp: two native integrators in a loop, b'' = 1 - b, from rest.

In continuous time a.x = sin(t) and b.x = 1 - cos(t).
"""

from grasp_cosim.interface.read import read_interface
from support.native_fmus import build

STARTS = {"u_Boolean": "false", "u_String": "''", "u_Enumeration": "1", "u_Real": "2.0"}
"""What the inputs of the FMU without a source are set to; other kinds to 0."""

CONNECTIONS = """connections = [
  { from = "b.x", to = "a.u_Real", factor = -1.0, offset = 1.0 },
  "a.x -> b.u_Real",
]
"""


def write_oscillator(folder, more="", stop=0.64):
    """The system file, with `more` at its end, and its FMU in folder; the file."""
    fmu = build(folder, "integrator", "2.0", {"x": "m", "now": "s"})
    inputs = [v.name for v in read_interface(fmu).of("input") if v.name != "u_Real"]
    values = ", ".join(f"{name} = {STARTS.get(name, '0')}" for name in inputs)
    text = f"{CONNECTIONS}[experiment]\nstep = 0.01\nstop = {stop}\n"
    for name in ("a", "b"):
        text += f"[components.{name}]\nfmu = 'integrator.fmu'\nvalues = {{ {values} }}\n"
    path = folder / "oscillator.toml"
    path.write_text(text + more, "utf-8")
    return path
