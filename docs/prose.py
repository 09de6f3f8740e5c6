"""Checks the English of the pages and of the code: make check.

    .venv/bin/python docs/prose.py [FILE ...]     # by default every tracked .md and .py file

Each finding is a line: file, line, rule, and the words. CONTRIBUTING.md explains the rules. vale
does the same for other languages of markup. Its package fetches a program from a server when it
first runs, and its rules cannot see docstrings of Python as sentences.
"""

import ast
import inspect
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parents[1]

MAX_WORDS = 25
"""In one sentence."""

MAX_CODE_COLUMNS = 80
"""Of a line in a code block, so that it fits on a page without a scroll bar."""

OUTPUT = ("", "console", "text")
"""Kinds of fenced blocks with the output of commands, whose lines are as they are."""

PROMPT = re.compile(r"\w*\$ ")


class Finding(NamedTuple):
    """A place that a reader stumbles over."""

    path: Path
    line: int
    rule: str
    words: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.rule}: {self.words}"


class Passage(NamedTuple):
    """A paragraph, a cell or a docstring as plain text, with the line at which it begins."""

    line: int
    text: str


SPEAKERS = (
    "command|column|error|file|FMU|header|line|log|manual|message|note|page|program|README|report|row"
    "|run|script|table|test|text|tool"
)

WORDING: dict[str, re.Pattern[str]] = {
    "write 'again', 'new' or 'from the start'": re.compile(r"\banew\b", re.I),
    "write 'next to', 'and' or 'in addition to'": re.compile(r"\bbesides?\b", re.I),
    "write 'only' or 'on its own'": re.compile(r"\balone\b", re.I),
    "write 'also' or 'and'": re.compile(r"\bas well\b(?! as\b)", re.I),
    "write 'its own X' or name the owner": re.compile(
        r"(?<!\bone )\bof (?:your|one's|its|their) own\b"
    ),
    "a thing does not speak: write 'contains', 'shows', 'names' or 'states'": re.compile(
        rf"\b(?:{SPEAKERS})s? (?:says?|said|tells?|told)\b", re.I
    ),
    "name who reports it, and where": re.compile(
        r"\b(?:is|are|be|was|were) said\b|\bwhich (?:says|tells)\b", re.I
    ),
    "use the common word: package, level, README, equation sheet, structure": re.compile(
        r"\b(?:rooms?|equation cards?|Cards?:)(?!\w)"
    ),
    "put the subject first": re.compile(
        r"(?:^|(?<=[.!?] ))(?:Not )?(?:Known|Given|Shown|Left|[A-Z]\w{2,}ed) (?:is|are|was|were)\b"
    ),
}
"""Words that a reader of English as a second language reads twice, by the words to write."""

PAGE_WORDING: dict[str, re.Pattern[str]] = {
    "name the thing instead of 'what'": re.compile(r"\bwhat\b(?![^.!?]*\?)", re.I),
    "write 'if' for a condition": re.compile(r"(?:^|(?<=[.!?] ))Where\b(?![^.!?]*\?)"),
    "make it two sentences instead of ';'": re.compile(r";"),
    "name the thing instead of 'ours' or 'theirs'": re.compile(r"\b(?:ours|theirs)\b", re.I),
}
"""The same, for pages."""

EVERYDAY = frozenset(
    [
        "API", "ARM", "ARM64", "ASCII", "C99", "CPU", "CSV", "END", "ETAS", "GB", "HTML",
        "HTTP", "II", "INCA", "IP", "IV", "JSON", "LED", "MATLAB", "MB", "MIT", "OK", "PI",
        "README", "ROS", "SHA256", "SI", "TODO", "TOML", "UDP", "URL", "USB", "UTF", "XML",
    ]
)  # fmt: skip
"""Abbreviations that every reader of these pages knows, and names that look like one."""

ABBREVIATION = re.compile(r"(?<![\w.-])[A-Z][A-Z0-9]+(?![\w-])")

VERBS_AS_HEADS = {"is", "are", "of", "does", "do", "means", "by", "has", "gives", "with", ""}


def words_of(text: str) -> int:
    """The number of words; code between backticks is one."""
    plain = re.sub(r"`[^`]*`", "code", text)
    return sum(any(letter.isalnum() for letter in word) for word in plain.split())


def sentences(text: str) -> list[str]:
    """The sentences of a passage; abbreviations such as "Eq." end none."""
    guarded = re.sub(r"\b(e\.g|i\.e|Eqs?|Fig|cf|vs|etc|al)\.", r"\1", text)
    return [
        part for part in re.split(r"(?<=[.!?])[)\"*]*\s+(?=[\"`(\[*]*[A-Z0-9`])", guarded) if part
    ]


def without_code(text: str) -> str:
    """A text without what stands between backticks or double quotes: names and citations."""
    return re.sub(r"`[^`]*`|\"[^\"]*\"", "X", text)


def wording(path: Path, passage: Passage, rules: dict[str, re.Pattern[str]]) -> Iterator[Finding]:
    """The words of a passage that the rules name."""
    text = without_code(passage.text)
    for rule, pattern in rules.items():
        for match in pattern.finditer(text):
            context = text[max(0, match.start() - 25) : match.end() + 25].replace("\n", " ")
            yield Finding(path, passage.line, rule, f"... {context} ...")


def long_sentences(path: Path, passage: Passage) -> Iterator[Finding]:
    """The sentences of a passage that are longer than MAX_WORDS."""
    for sentence in sentences(passage.text):
        if (count := words_of(sentence)) > MAX_WORDS:
            rule = f"{count} words in a sentence, at most {MAX_WORDS}"
            yield Finding(path, passage.line, rule, sentence[:60])


# Pages

VARIABLE_TABLES = re.compile(r"^<!-- variables -->.*<!-- end of variables -->$", re.DOTALL | re.M)
"""Tables that `make tables` writes from the descriptions of variables."""

MARKDOWN = MarkdownIt("commonmark").enable("table")


@cache
def glossary() -> frozenset[str]:
    """The words that the glossary explains, from the first column of its tables."""
    words: set[str] = set()
    tokens = MARKDOWN.parse((ROOT / "docs/reference/glossary.md").read_text("utf-8"))
    for before, token in pairwise(tokens):
        if before.type == "td_open" and token.content:
            words.update(re.split(r"[ ,()]+", plain(token)))
    return frozenset(words)


def undefined_abbreviations(path: Path, tokens: Sequence[Token]) -> Iterator[Finding]:
    """The first use of each abbreviation that neither the page nor the glossary explains.

    An abbreviation is explained by a use in parentheses after its words. Placeholders, which occur
    in a code block of the page in the same letters, are none.
    """
    code = " ".join(token.content for token in tokens if token.type in ("fence", "code_block"))
    whole = " ".join(plain(token) for token in tokens if token.type == "inline")
    known = {*EVERYDAY, *glossary(), *ABBREVIATION.findall(code)}
    known |= {*re.findall(r"\(([A-Z][A-Z0-9]+)\)", whole)}
    for token in tokens:
        if token.type != "inline" or token.map is None:
            continue
        for word in ABBREVIATION.findall(without_code(plain(token))):
            if word not in known and not (word.endswith("S") and word[:-1] in known):
                known.add(word)
                rule = "explain the abbreviation in the glossary, or write it out"
                yield Finding(path, token.map[0] + 1, rule, word)


def inactive_commands(path: Path, tokens: Sequence[Token], text: str) -> Iterator[Finding]:
    """The first command of a page that does not name the environment to activate."""
    if ACTIVATE in text:
        return
    for token in tokens:
        is_code = token.type in ("fence", "code_block")
        if is_code and token.map and COMMAND.search(token.content):
            yield Finding(path, token.map[0] + 1, f"name `{ACTIVATE}` once on the page", "")
            return


ACTIVATE = "source .venv/bin/activate"
COMMAND = re.compile(r"^(?:\w*\$ )?grasp-cosim (?!\d)", re.MULTILINE)


def plain(token: Token) -> str:
    """The text of an inline token without pictures; code keeps its backticks."""
    parts = []
    for child in token.children or []:
        if child.type == "code_inline":
            parts.append(f"`{child.content}`")
        elif child.type in ("softbreak", "hardbreak"):
            parts.append(" ")
        elif child.type == "text":
            parts.append(child.content)
    return "".join(parts)


def begins_bold(token: Token) -> bool:
    """Whether an inline token begins with bold words that a heading should be."""
    kinds = [child.type for child in token.children or [] if child.content or child.nesting]
    return len(kinds) > 3 and kinds[0] == "strong_open"


def page_findings(path: Path, text: str) -> Iterator[Finding]:
    """All findings on one page of Markdown."""
    tokens = MARKDOWN.parse(VARIABLE_TABLES.sub(lambda tables: "\n" * tables[0].count("\n"), text))
    yield from undefined_abbreviations(path, tokens)
    yield from inactive_commands(path, tokens, text)
    line, in_list = 1, 0
    for before, token in pairwise([Token("", "", 0), *tokens]):
        line = token.map[0] + 1 if token.map else line
        in_list += token.nesting * (token.type in ("list_item_open", "list_item_close"))
        if token.type in ("fence", "code_block"):
            yield from code_lines(path, line, token)
        if token.type != "inline":
            continue
        passage = Passage(line, plain(token))
        yield from wording(path, passage, WORDING)
        yield from wording(path, passage, PAGE_WORDING)
        yield from long_sentences(path, passage)
        if before.type == "paragraph_open" and not in_list and begins_bold(token):
            yield Finding(path, line, "make the bold words a heading", passage.text[:40])
        if before.type == "th_open" and passage.text.strip().lower() in VERBS_AS_HEADS:
            yield Finding(path, line, "name the column by a noun", repr(passage.text))


def code_lines(path: Path, line: int, token: Token) -> Iterator[Finding]:
    """The lines of a code block that do not fit on a page."""
    first = line + (token.type == "fence")
    kind = token.info if token.type == "fence" else "indented"
    continued = False
    for number, code in enumerate(token.content.splitlines(), first):
        is_code = kind not in OUTPUT or continued or bool(PROMPT.match(code))
        continued = is_code and code.endswith("\\")
        if is_code and len(code) > MAX_CODE_COLUMNS:
            rule = f"{len(code)} columns of code, at most {MAX_CODE_COLUMNS}"
            yield Finding(path, number, rule, code[:40].strip())


# Code


def docstrings(tree: ast.Module) -> Iterator[Passage]:
    """The docstrings of a module, also those below a constant or a field."""
    for node in ast.walk(tree):
        for statement in getattr(node, "body", []) if isinstance(node, Scope) else []:
            match statement:
                case ast.Expr(value=ast.Constant(value=str(text))):
                    yield Passage(statement.lineno, text)


Scope = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def comments(source: str) -> Iterator[Passage]:
    """The comments of a module; lines that follow each other are one passage."""
    first, last = 0, 0
    lines: list[str] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        if lines and token.start[0] != last + 1:
            yield Passage(first, " ".join(lines))
            lines = []
        if not lines:
            first = token.start[0]
        last = token.start[0]
        lines.append(token.string.lstrip("# "))
    if lines:
        yield Passage(first, " ".join(lines))


def clauses(docstring: str) -> Iterator[str]:
    """The clauses of a docstring, without examples, equations and other indented blocks.

    A clause ends at a full stop, a semicolon or a colon; an entry such as "name: text" begins one.
    """
    lines = inspect.cleandoc(docstring.partition("Example:\n")[0]).splitlines()
    plain_lines: list[str] = []
    in_section = False
    for line in lines:
        if SECTION.fullmatch(line):
            in_section = True
            plain_lines.append("")
        elif ENTRY.match(line) and in_section:
            plain_lines += ["", line.partition(": ")[2]]
        elif line.startswith("    ") and not in_section:
            plain_lines.append("")  # an equation, a table or code
        else:
            plain_lines.append(line.strip())
    for paragraph in re.split(r"\n\n+|\n- ", "\n".join(plain_lines)):
        yield from re.split(r"[.;:] ", " ".join(paragraph.split()))


SECTION = re.compile(r"(Args|Returns|Raises|Yields|Attributes):")
ENTRY = re.compile(r"    \*{0,2}\w+: ")


def code_findings(path: Path, source: str) -> Iterator[Finding]:
    """All findings in the docstrings, comments and texts of one module."""
    tree = ast.parse(source)
    texts = [
        Passage(node.lineno, node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value
    ]
    for passage in [*texts, *comments(source)]:
        yield from wording(path, passage, WORDING)
    for passage in docstrings(tree):
        for clause in clauses(passage.text):
            yield from long_sentences(path, Passage(passage.line, clause))


def findings(path: Path) -> Iterator[Finding]:
    """All findings in one file, named from the top of the checkout."""
    text = path.read_text("utf-8")
    name = path.resolve().relative_to(ROOT)
    if path.suffix == ".md":
        yield from page_findings(name, text)
    else:
        yield from code_findings(name, text)


EXEMPT = (":!tests", ":!CHANGELOG.md", ":!docs/prose.py")
"""Texts that stay as they were written, and the words that this file looks for."""


def tracked() -> list[Path]:
    """The pages and the modules that are in the repository, without the tests."""
    command = ["git", "-C", str(ROOT), "ls-files", "--", "*.md", "*.py", *EXEMPT]
    listed = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    return [ROOT / name for name in listed.stdout.splitlines()]


def main(arguments: Sequence[str]) -> int:
    """Print each finding; the exit code is 1 if there is one."""
    count = 0
    for path in [Path(name) for name in arguments] or tracked():
        for finding in findings(path):
            print(finding)
            count += 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
