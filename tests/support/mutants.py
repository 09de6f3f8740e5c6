"""Damaged system files, FMUs and SSP archives, and what the commands make of them.

As a program (`python -m support.mutants KIND FIRST COUNT FMUS FOLDER`) it tries so many seeds, each
in a fork of its own with its own HOME, TMPDIR and current folder, and prints a line of JSON for
each of the commands. A fork, since that takes a tenth of the time of a new process.
"""

import json
import os
import random
import resource
import signal
import sys
import time
import tomllib
import zipfile
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

LIMIT, PATIENCE = 10.0, 100.0
"""s of processor time for a command and the processes it starts; s until it is ended as hanging."""

MEMORY = 8 << 30
"""Bytes of address space for a command: what wants more fails, instead of the machine."""

NUMBERS = (
    0, -1, 1, 2, 1e-320, 1e-9, 0.1, 1e300, -1e300, 1e308, 2**31, 2**32, 2**53 + 1, 2**63, 2**64,
    10**400, float("nan"), float("inf"), float("-inf"), -0.0, 1e-4, 3,
)  # fmt: skip
TEXTS = (
    "", " ", "x", "plant", "plant.gap[1]", "sensor_1.gap", "a.b.c", ".", "->", "a -> b", "../x",
    "/etc/passwd", "/dev/zero", ".", "..", "\0", "\n", "\x1b[2J", "\u202e", "é", "𝒳", "\ud7ff",
    "x" * 5000, "{}", "%s%n", "nan", "inf", "1e999", "-1", "4294967296", "9" * 5000, "true", "1",
    "NaN", "INF", "-INF", "0x10", "1_000", "none", "process", "Real", "input", "output", "kg m/s",
)  # fmt: skip
NAMES = (
    "../outside", "../../outside", "/tmp/outside", "C:\\outside", "C:outside", "..\\outside",
    "a\\b", "resources", "resources/", "binaries", "x" * 300, "a/" * 200 + "b", "é", "\x01", "\0x",
    "modelDescription.xml", "./modelDescription.xml", "SystemStructure.ssd", "~/outside", "",
    "resources/../../outside", "//outside", "binaries/linux64/../../../outside", "ü",
)  # fmt: skip

OUTSIDE = Path("/tmp/outside")
Random = random.Random


def mutated_bytes(data, rng):
    """A few bytes changed, lost, doubled or put in, or the end cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 30))):
        at = rng.randrange(len(out) + 1)
        length = rng.choice((1, 1, 2, 8, 100))
        match rng.randrange(6):
            case 0 if out:
                out[at % len(out)] ^= 1 << rng.randrange(8)
            case 1:
                del out[at : at + length]
            case 2:
                out[at:at] = rng.randbytes(length)
            case 3:
                out[at:at] = out[at : at + length]
            case 4:
                out[at : at + length] = rng.choice((b"\0", b"\xff", b'"', b"<", b"\n")) * length
            case 5 if rng.random() < 0.2:
                del out[at:]
    return bytes(out)


def mutated_lines(text, rng):
    """A few lines lost, doubled, swapped, or a word of theirs replaced."""
    lines = text.splitlines() or [""]
    for _ in range(rng.choice((1, 1, 2, 4))):
        a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
        match rng.randrange(4):
            case 0:
                lines[a] = ""
            case 1:
                lines.insert(b, lines[a])
            case 2:
                lines[a], lines[b] = lines[b], lines[a]
            case 3:
                words = lines[a].split(" ")
                words[rng.randrange(len(words))] = str(rng.choice((*TEXTS, *NUMBERS)))
                lines[a] = " ".join(words)
    return "\n".join(lines)


def _value(rng, depth=0):
    kind = rng.randrange(9)
    if kind < 3:
        return rng.choice(NUMBERS)
    if kind < 6 or depth > 2:
        return rng.choice(TEXTS)
    if kind == 6:
        return rng.random() < 0.5
    if kind == 7:
        return [_value(rng, depth + 1) for _ in range(rng.randrange(4))]
    return {rng.choice(TEXTS): _value(rng, depth + 1) for _ in range(rng.randrange(3))}


def _paths(node):
    """Yield the keys that lead to each place of a tree but its root."""
    for key in node if isinstance(node, dict) else range(len(node)):
        yield (key,)
        if isinstance(node[key], dict | list):
            yield from ((key, *rest) for rest in _paths(node[key]))


def _mutate_tree(node, rng):
    """One place of a tree of tables and lists changed."""
    if isinstance(node, dict | list) and rng.random() < 0.5 and node:
        path = rng.choice(list(_paths(node)))
        inner = node
        for key in path[:-1]:
            inner = inner[key]
        inner[path[-1]] = _value(rng)
        return node
    if not isinstance(node, dict | list) or not node or rng.random() < 0.08:
        return _value(rng)
    keys = list(node) if isinstance(node, dict) else list(range(len(node)))
    key = rng.choice(keys)
    match rng.randrange(10):
        case 0:
            del node[key]
        case 1 if isinstance(node, dict):
            node[rng.choice((*TEXTS, *map(str, keys)))] = node.pop(key)
        case 2 if isinstance(node, dict):
            node[rng.choice(TEXTS)] = _value(rng)
        case 2 | 1 if isinstance(node, list):
            node.insert(0, node[key])
        case 3 if isinstance(node, dict):
            node[key] = node[rng.choice(keys)]
        case _:
            node[key] = _mutate_tree(node[key], rng)
    return node


def as_toml(value):
    """A value as TOML has it on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(k)} = {as_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return _quoted(value) if isinstance(value, str) else repr(value)


def _quoted(text):
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "")


def mutated_toml(text, rng):
    """A system file with something wrong, or other than it was."""
    kind = rng.randrange(10)
    if kind == 0:
        return mutated_bytes(text.encode(), rng)
    if kind < 3:
        return mutated_lines(text, rng).encode(errors="replace")
    tree = tomllib.loads(text)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        tree = _mutate_tree(tree, rng)
        if not isinstance(tree, dict):
            return as_toml(tree).encode(errors="replace")
    return "\n".join(f"{_quoted(k)} = {as_toml(v)}" for k, v in tree.items()).encode(
        errors="replace"
    )


def mutated_xml(data, rng):
    """A document with something wrong, or other than it was."""
    kind = rng.randrange(10)
    if kind == 0:
        return mutated_bytes(data, rng)
    if kind == 1:
        encoding = rng.choice(("utf-16", "utf-32", "latin-1", "cp037", "utf-8-sig", "utf-7"))
        return data.decode(errors="replace").encode(encoding, errors="replace")
    if kind == 2:
        return mutated_lines(data.decode(errors="replace").replace(">", ">\n"), rng).encode(
            errors="replace"
        )
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError:
        return mutated_bytes(data, rng)
    for _ in range(rng.choice((1, 1, 2, 4))):
        _mutate_element(root, rng)
    text = ElementTree.tostring(root, encoding="unicode")
    if kind == 3:
        place = rng.randrange(len(text))
        place = text.find(">", place) + 1
        inside = rng.choice((
            "<a>" * 500, "&amp;" * 1000, "&x;", "<![CDATA[x]]>", "<!--x-->", "<?x?>", "x" * 1000,
            "<a>" * 300 + "</a>" * 300, '<!DOCTYPE a [<!ENTITY x "y">]>', '<a b="c" b="c"/>',
        ))  # fmt: skip
        text = text[:place] + inside + text[place:]
    return text.encode(errors="replace")


def _mutate_element(root, rng):
    parents = [e for e in root.iter() if len(e)]
    elements = list(root.iter())
    parent, element = rng.choice(parents or [root]), rng.choice(elements)
    children, attributes = list(parent), list(element.attrib)
    what = rng.randrange(9)
    if what == 0 and children:
        parent.remove(rng.choice(children))
    elif what == 1 and children:
        parent.insert(0, rng.choice(children))
    elif what == 2 and children:
        parent[:] = rng.sample(children, len(children))
    elif what == 3:
        element.tag = rng.choice([e.tag for e in elements])
    elif what == 4:
        element.text = rng.choice([t for t in TEXTS if t.isprintable()])
    elif attributes:
        key = rng.choice(attributes)
        value = str(rng.choice((*TEXTS, *NUMBERS[:-1])))
        value = "".join(c for c in value if c.isprintable() or c in "\n\t")
        if what == 5:
            del element.attrib[key]
        elif what == 6:
            element.attrib[rng.choice([k for e in elements for k in e.attrib])] = value
        else:
            element.attrib[key] = value


def mutated_zip(data, rng, mutate):
    """An archive with its bytes, its entries or, as `mutate` sees fit, their content changed."""
    if rng.random() < 0.15:
        return mutated_bytes(data, rng)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        entries = [(i.filename, archive.read(i)) for i in archive.infolist()]
    names, mode = [name for name, _ in entries], 0
    what = rng.randrange(12)
    at = rng.randrange(len(entries))
    if what == 0:
        del entries[at]
    elif what == 1:
        entries[at] = (rng.choice(NAMES), entries[at][1])
    elif what == 2:
        entries.append((rng.choice((*NAMES, *names)), entries[at][1]))
    elif what == 3:
        entries.append((rng.choice((*NAMES, *names)), rng.choice((b"", b"/etc/passwd", b"x" * 9))))
        mode = rng.choice((0o120777, 0o020777, 0o040000)) << 16  # a link, a device, a folder
    elif what == 4:
        entries[at] = (entries[at][0], mutated_bytes(entries[at][1], rng))
    else:
        entries = [(name, mutate(name, content, rng)) for name, content in entries]
    out = BytesIO()
    kind = rng.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    with zipfile.ZipFile(out, "w", kind) as archive:
        for number, (name, content) in enumerate(entries):
            info = zipfile.ZipInfo("x")
            info.filename, info.compress_type = name, kind
            info.external_attr = mode if number == len(entries) - 1 else 0
            with suppress(zipfile.BadZipFile):
                archive.writestr(info, content)
    made = bytearray(out.getvalue())
    if what == 5:  # the directory lies about an entry
        at = made.find(b"PK\x01\x02", rng.randrange(len(made)))
        made[at + rng.choice((8, 10, 16, 20, 24, 28, 42))] ^= 1 << rng.randrange(8)
    return bytes(made)


def _of_fmu(name, content, rng):
    if name == "modelDescription.xml" and rng.random() < 0.8:
        return mutated_xml(content, rng)
    if name.endswith((".py", ".txt", ".so")) and rng.random() < 0.1:
        return mutated_bytes(content, rng)
    return content


def _of_ssp(name, content, rng):
    if name.endswith((".ssd", ".ssv", ".ssm")) and rng.random() < 0.7:
        return mutated_xml(content, rng)
    return (
        mutated_zip(content, rng, _of_fmu)
        if name.endswith(".fmu") and rng.random() < 0.1
        else content
    )


def system_text(fmus):
    """A system that has all that a system file can have."""
    from grasp_cosim.grasp.presets import SYSTEM

    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    return f"""{text}
[initialisation]
loops = "iterate"
tolerance = 1e-10
iterations = 50
[roles]
plant = "plant"
[[events]]
at = 0.001
set = {{ "sensor_1.reflectance" = 0.6 }}
[[events]]
when = "plant.gap[1] < 0.01"
set = {{ "sensor_1.reflectance" = 0.4 }}
[[faults]]
connection = "sensor_1.intensity -> controller.intensity[1]"
kind = "noise"
standard_deviation = 0.002
from = 0.001
until = 0.003
seed = 1
[[faults]]
connection = "plant.gap[1] -> sensor_1.gap"
kind = "delay"
time = 0.0002
""".replace(
        "[components.sensor_2]\n",
        '[components.sensor_2]\nstep = 2e-4\nrename = { glow = "intensity" }\n',
    ).replace("sensor_2.intensity", "sensor_2.glow")


Case = tuple[str, list[list[str]]]
"""The name of a file in the folder, and the command lines to try it with."""


def make(kind, seed, fmus, folder, archive):
    """Write the mutant of a seed to the folder; yield the command lines to try."""
    rng = random.Random(f"{kind} {seed}")
    if kind == "toml":
        path = folder / "system.toml"
        path.write_bytes(mutated_toml(system_text(fmus), rng))
        yield ["run", str(path), "--stop", "0.002", "--step", "1e-4", "--out", "out"]
    elif kind == "fmu":
        path = folder / "mutant.fmu"
        name = rng.choice(("GripperPlant", "ProximitySensor", "GraspController"))
        path.write_bytes(mutated_zip((fmus / f"{name}.fmu").read_bytes(), rng, _of_fmu))
        role = {"GripperPlant": "plant", "ProximitySensor": "sensor_1"}.get(name, "controller")
        system = folder / "system.toml"
        system.write_text(system_text(fmus), "utf-8")
        yield ["inspect", str(path)]
        yield ["inspect", str(path), "--load"]
        yield ["run", str(system), "--swap", f"{role}={path}", "--stop", "0.001",
               "--set", f"components.{role}.isolation=process", "--out", "out"]  # fmt: skip
    else:
        path = folder / "mutant.ssp"
        path.write_bytes(mutated_zip(archive, rng, _of_ssp))
        yield ["run", str(path), "--stop", "0.001", "--out", "out"]
        yield ["ssp", str(path), "-o", "out/again.ssp"]


def tree(folder):
    """All below a folder, with sizes and times of change."""
    found = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        size = 0 if path.is_dir() else status.st_size
        found[str(path.relative_to(folder))] = (size, 0 if path.is_dir() else status.st_mtime_ns)
    return found


def attempt(arguments, folder, said):
    """Exit code of a command line, minus a signal's number or None for no end; s of processor."""
    from grasp_cosim import cli

    began = time.monotonic()
    child = os.fork()
    if not child:
        os.setpgid(0, 0)
        with said.open("wb") as log, Path(os.devnull).open() as nothing:
            os.dup2(nothing.fileno(), 0)
            os.dup2(log.fileno(), 1)
            os.dup2(log.fileno(), 2)
        os.chdir(folder / "here")
        os.environ |= {"HOME": str(folder / "home"), "TMPDIR": str(folder / "temporary")}
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        code = cli.main(arguments)
        sys.stdout.flush()
        sys.stderr.flush()
        import atexit

        atexit._run_exitfuncs()
        os._exit(code)
    while time.monotonic() < began + PATIENCE:
        ended, status, used = os.wait4(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime
        time.sleep(0.005)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None, PATIENCE


def complaints(code, said, changed):
    """What is wrong with how a command ended."""
    lines = said.splitlines()
    errors = [line for line in lines if line.startswith("grasp-cosim: ")]
    found = []
    if code not in (0, 1, 2, 3):
        found.append(f"exit code {code}")
    if code in (2, 3) and (len(errors) != 1 or lines[-1] != errors[0]):
        found.append(f"{len(errors)} lines of error")
    if errors and "--debug shows where" in errors[0]:
        found.append("an error that nobody foresaw")
    if any(len(line) > 3000 for line in errors):
        found.append("a line of error that nobody reads")
    if any(not c.isprintable() for line in errors for c in line):
        found.append("control characters")
    found += [word for word in ("Traceback", "Warning:") if word in said]
    return found + [f"wrote {name}" for name in changed]


def main(kind, first, count, fmus, folder):
    """Try seeds and print what came of it."""
    from grasp_cosim import System
    from grasp_cosim.cli.commands import inspect, run, ssp  # noqa: F401
    from grasp_cosim.ssp.to_archive import write_ssp

    folder.mkdir(parents=True)
    (folder / "clean.toml").write_text(system_text(fmus), "utf-8")
    write_ssp(System.load(folder / "clean.toml"), folder / "clean.ssp")
    archive = (folder / "clean.ssp").read_bytes()
    for seed in range(first, first + count):
        place = folder / f"{kind}{seed}"
        for name in ("home", "temporary", "here", "input"):
            (place / name).mkdir(parents=True)
        for arguments in make(kind, seed, fmus, place / "input", archive):
            before = tree(place)
            code, took = attempt(arguments, place, folder / "said.txt")
            after = tree(place)
            changed = [
                n for n in before.keys() | after.keys()
                if before.get(n) != after.get(n) and not n.startswith("here/out")
            ]  # fmt: skip
            said = (folder / "said.txt").read_text("utf-8", errors="replace")
            wrong = complaints(code, said, changed if code is not None else [])
            wrong += [f"took {took:.1f} s"] * (took > LIMIT)
            wrong += [f"wrote {OUTSIDE}"] * OUTSIDE.exists()
            last = (said.splitlines() or [""])[-1]
            result = {"kind": kind, "seed": seed, "command": arguments[0], "code": code}
            line = json.dumps({**result, "s": round(took, 2), "wrong": wrong, "said": last[:3000]})
            sys.stdout.write(line + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    what, start, many, *places = sys.argv[1:]
    main(what, int(start), int(many), *(Path(place).resolve() for place in places))
