"""What a page tells its reader to type."""

import re

BLOCKS = re.compile(r"```(console|toml|python)\n(.*?)```", re.DOTALL)
INDENTED = re.compile(r"^    (grasp-cosim .*?)(?:\s+#.*)?$", re.MULTILINE)


def commands_of(block):
    """The commands of a console, each with what is shown below it."""
    whole = block.replace("\\\n", " ")
    for part in re.findall(r"^\$ (.*?)(?=^\$ |\Z)", whole, re.MULTILINE | re.DOTALL):
        command, _, shown = part.partition("\n")
        yield command, shown


def fill_in(system, block):
    """Put each line of a table in the place of that with its key."""
    chunks = system.read_text("utf-8").split("\n\n")
    for table in block.strip().split("\n\n"):
        heading, *new = table.splitlines()
        (place,) = (i for i, chunk in enumerate(chunks) if chunk.startswith(heading))
        lines = {line.partition(" = ")[0]: line for line in chunks[place].splitlines()}
        for line in new:
            assert line.partition(" = ")[0] in lines
            lines[line.partition(" = ")[0]] = line
        chunks[place] = "\n".join(lines.values())
    system.write_text("\n\n".join(chunks), encoding="utf-8")
