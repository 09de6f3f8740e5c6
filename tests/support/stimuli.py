"""A system of one native FMU whose inputs a CSV file drives."""

from .native_fmus import TYPES, build

STARTS = {"Boolean": "false", "String": "''", "Enumeration": "1"}
REALS = {"2.0": "Real", "3.0": "Float64"}


def driven(folder, text, version="2.0", more="", own="", step=0.1):
    """The system file driven.toml in folder, of a component a; drive.csv beside it has the text.

    Inputs that the text does not name have values. more is in the file, own in its component.
    """
    build(folder, "native", version, {f"u_{REALS[version]}": "N"}, complete=version == "3.0")
    names = [f"u_{t}" for t in TYPES[version] if f"a.u_{t}" not in text.partition("\n")[0]]
    values = ", ".join(f"{n} = {STARTS.get(n[2:], '0')}" for n in names)
    (folder / "drive.csv").write_text(text, "utf-8")
    path = folder / "driven.toml"
    path.write_text(
        f"connections = []\n[experiment]\nstep = {step}\nstop = 1.0\n{more}\n[components.a]\n"
        f'fmu = "native.fmu"\nvalues = {{ {values} }}\n{own}\n',
        "utf-8",
    )
    return path
