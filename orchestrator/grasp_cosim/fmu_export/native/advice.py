"""What to write in the place of what a block in C cannot have."""

import math
from collections.abc import Mapping
from typing import Any

ADVICE: Mapping[Any, str] = {
    "Lambda": "lambda is not in the subset; use a function of the module",
    "List": "a list is not in the subset; use a tuple",
    **dict.fromkeys(
        ("ListComp", "SetComp"), "a list or set is not in the subset; use tuple(... for ...)"
    ),
    **dict.fromkeys(
        ("Dict", "DictComp"), "a dict is not in the subset; use a MappingProxyType of the module"
    ),
    "NamedExpr": ":= is not in the subset; assign before",
    "GeneratorExp": "a generator is only for any, all and tuple",
    "FloorDiv": "// is not in the subset; write floor(a / b)",
    "Mod": "% is not in the subset; write fmod(a, b)",
    "While": "while is not in the subset, as a step must end; use for ... in range(n) with break",
    "FunctionDef": "a function in a function is not in the subset; put it into the module",
    "Try": "try is not in the subset; ask before",
    "Global": "global is not in the subset; what is to be kept belongs into State",
    "Match": "match is not in the subset; use if and elif",
    "Raise": "raise is only for __post_init__; a step whose outputs are not finite is refused",
    **dict.fromkeys(
        ("Import", "ImportFrom"),
        "import in a function is not in the subset; put it at the top of the module",
    ),
    "Set": "a set is not in the subset; use a tuple",
    "JoinedStr": "a text is not in the subset, but for that of ValueError in __post_init__",
    "Assert": "assert is not in the subset; leave it out, or raise ValueError in __post_init__",
    "With": "with is not in the subset; leave it out, a block opens nothing",
    "Delete": "del is not in the subset; leave it out",
    "ClassDef": "a class in a function is not in the subset; put it into the module",
    "Nonlocal": "nonlocal is not in the subset; what is to be kept belongs into State",
    "In": "in is not in the subset; write x == a or x == b",
    "NotIn": "not in is not in the subset; write x != a and x != b",
    "Is": "is compares objects, and is not in the subset; write ==",
    "IsNot": "is not compares objects, and is not in the subset; write !=",
    range: "range is not in the subset but for a loop: for ... in range(n), or range(first, n)",
    enumerate: "enumerate is not in the subset; write for ... in zip((0, 1), items)",
    map: "map is not in the subset; use tuple(... for ...)",
    filter: "filter is not in the subset; use if in a loop",
    reversed: "reversed is not in the subset; write items[::-1]",
    sorted: "sorted is not in the subset; use min and max",
    print: "print is not in the subset; make it an output, which is recorded",
    isinstance: "isinstance is not in the subset; leave it out, a variable has one type",
    bool: "bool is not in the subset; write x != 0.0",
    pow: "pow is not in the subset; write a ** b",
    divmod: "divmod is not in the subset; write floor(a / b) and fmod(a, b)",
    complex: "complex is not in the subset; use two floats",
    **dict.fromkeys((list, set), "a list or set is not in the subset; use a tuple"),
    dict: "a dict is not in the subset; use a MappingProxyType of the module",
    **dict.fromkeys((str, repr, format), "a text is not in the subset; use a number"),
    math.radians: "math.radians is not in the subset; write x * (pi / 180.0)",
    math.degrees: "math.degrees is not in the subset; write x * (180.0 / pi)",
    math.isfinite: "math.isfinite is not in the subset; write abs(x) < inf",
    math.isinf: "math.isinf is not in the subset; write abs(x) == inf",
    math.isnan: "math.isnan is not in the subset; write x != x",
    math.isclose: "math.isclose is not in the subset; write abs(a - b) <= tolerance",
    math.prod: "math.prod is not in the subset; write a * b, or a loop",
    math.dist: "math.dist is CPython's own; write sqrt(x * x + y * y)",
    sum: "sum: its rounding depends on the version of Python; write a + b, or a loop",
    math.fsum: "math.fsum is not in the subset; write a + b, or a loop",
    math.hypot: "math.hypot is CPython's own; write sqrt(x * x + y * y)",
    round: "round is not in the subset; write floor(x + 0.5)",
}
"""By the name of a node of Python's syntax, or by a function: all else is refused without more."""
