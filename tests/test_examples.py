"""Properties: the same examples in every run of the tests, others in `make explore`."""

import ast
from pathlib import Path

from hypothesis import settings
from support.marks import examples

TESTS = Path(__file__).parent


def test_only_exploring_draws_other_examples_and_more():
    usual, explore = (settings.get_profile(name) for name in ("usual", "explore"))
    assert (usual.derandomize, explore.derandomize) == (True, False)
    assert explore.max_examples == 40 * usual.max_examples
    assert explore.print_blob


def test_a_count_of_examples_is_that_of_the_usual_profile():
    current = settings.get_current_profile_name()
    try:
        for name, count in (("usual", 15), ("explore", 600)):
            settings.load_profile(name)
            assert examples(60).max_examples == count
            assert examples(60).derandomize is settings.get_profile(name).derandomize
    finally:
        settings.load_profile(current)


def test_no_test_sets_its_own_randomness():
    found = [
        f"{file.relative_to(TESTS)}:{node.lineno}"
        for file in sorted(TESTS.rglob("test_*.py"))
        if any(
            name in (text := file.read_text("utf-8")) for name in ("derandomize", "max_examples")
        )
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.keyword) and node.arg in ("derandomize", "max_examples")
    ]
    assert found == []
