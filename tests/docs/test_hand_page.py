"""The examples of docs/hand.md run, and what they assert holds."""

import re
from pathlib import Path

from support.both_engines import needs_compiler

PAGE = (Path(__file__).parents[2] / "docs/hand.md").read_text("utf-8")


@needs_compiler
def test_the_examples_hold():
    names = {}
    found = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert len(found) == 3
    for example in found:
        exec(example, names)
