"""`python -m grasp_cosim` is `grasp-cosim`, but that Python starts it in the current folder.

It is the first one where Python looks for modules, and where it looked for the first few already:
`python -P -m grasp_cosim` does not. Nothing else is imported from there.
"""

import sys
from pathlib import Path

if __name__ == "__main__":
    if not sys.flags.safe_path and sys.path[0] == str(Path.cwd()):
        del sys.path[0]
    from .cli import entry

    entry()
