"""Systems that are no grasp: of native FMUs, which integrate."""

from grasp_cosim import System

from .native_fmus import build, starts_text

CONNECTIONS = """connections = [
  { from = "b.x", to = "a.u_Real", factor = -1.0, offset = 1.0 },
  "a.x -> b.u_Real",
]
"""


def write_oscillator(folder, more="", stop=0.64):
    """Two integrators in a loop, b'' = 1 - b, from rest: a.x = sin(t), b.x = 1 - cos(t).

    The system file, with `more` at its end, and its FMU in folder; the file."""
    build(folder, "integrator", "2.0", {"x": "m", "now": "s"})
    values = starts_text("2.0", "u_Real")
    text = f"{CONNECTIONS}[experiment]\nstep = 0.01\nstop = {stop}\n"
    for name in ("a", "b"):
        text += f"[components.{name}]\nfmu = 'integrator.fmu'\nvalues = {{ {values} }}\n"
    path = folder / "oscillator.toml"
    path.write_text(text + more, "utf-8")
    return path


METRICS = '''from grasp_cosim import metric


@metric("end", unit="m", needs=["a.x"])
def end(run):
    """The last value."""
    return run["a.x"][-1]


@metric("half", entries=("first", "second"))
def half(run):
    """At both halves of the time."""
    return [run["a.x"][len(run.time) // 2] > 0.1, None]
'''


def write_integrator(folder):
    """a.x is the integral of gain·u: a.fmu, system.toml and mine.py in folder; returns it."""
    build(folder, "a", "2.0")
    values = f"u_Real = 2.0, {starts_text('2.0', 'u_Real')}"
    (folder / "system.toml").write_text(
        f"[experiment]\nstep = 0.01\nstop = 0.1\n[components.a]\nfmu = 'a.fmu'\n"
        f"values = {{ {values} }}\n"
    )
    (folder / "mine.py").write_text(METRICS)
    return folder


def integrator(folder):
    return System.load(write_integrator(folder) / "system.toml")


REALS = {"2.0": "Real", "3.0": "Float64"}


def driven(folder, text, version="2.0", more="", own="", step=0.1):
    """The system file driven.toml in folder, of a component a; drive.csv beside it has the text.

    Inputs that the text does not name have values. more is in the file, own in its component.
    """
    build(folder, "native", version, {f"u_{REALS[version]}": "N"}, complete=version == "3.0")
    columns = [name.strip().removeprefix("a.") for name in text.partition("\n")[0].split(",")]
    values = starts_text(version, *columns)
    (folder / "drive.csv").write_text(text, "utf-8")
    path = folder / "driven.toml"
    path.write_text(
        f"connections = []\n[experiment]\nstep = {step}\nstop = 1.0\n{more}\n[components.a]\n"
        f'fmu = "native.fmu"\nvalues = {{ {values} }}\n{own}\n',
        "utf-8",
    )
    return path
