"""The documentation's pages as its tests read them: navigation, links, headings, commands, Python."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
MADE_BY_THE_BUILD = {"reference/api/synthroads_addon/index", "reference/api/ml/index"}
"""Pages that the site's generator writes itself."""

_FENCE = re.compile(r"^(```+)(\S*)[^\n]*\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"!?\[(?:[^\]\[]|\[[^\]]*\])*\]\(([^)\s]+)\)")
_IMPORT = re.compile(r"(?:^ *|`)((?:from|import) (?:synthroads_addon|headless|ml)\b[^`#\n]*)", re.MULTILINE)
_MODULE = re.compile(r"(?<![\w./])(?:synthroads_addon|headless|ml)(?:\.[a-z]\w*)+(?:\.\w+)?")
_FOLDERS = "synthroads_addon|headless|ml|tests|tools|studies|docs|presets"
_FILE = re.compile(rf"(?<![\w./-])(?:{_FOLDERS})/[\w./-]*\w(?:::\w+)*")
_OLD = re.compile(r"(?m)^\| `[^|]*\| (?=[^|]*\|$)")
_SHELL = {"|", ">", ">>", "<", "&&", ";"}


def fences(text: str, *languages: str) -> list[str]:
    """Return the content of the fenced blocks in some languages."""
    return [match[3] for match in _FENCE.finditer(text) if match[2] in languages]


def entries(page: Path) -> list[str]:
    """Return the pages that a page's toctrees name, as seen from the documentation's root."""
    blocks = fences(page.read_text(encoding="utf-8"), "{toctree}")
    named = [line.strip() for block in blocks for line in block.splitlines() if line.strip() and line[0] != ":"]
    folder = page.parent.relative_to(DOCS)
    return [name[1:] if name.startswith("/") else (folder / name).as_posix() for name in named]


def current(page: Path) -> str:
    """Return a page's text; of the changelog without the first of two columns, which says how something was called."""
    text = page.read_text(encoding="utf-8")
    return _OLD.sub("| ", text) if page.name == "CHANGELOG.md" else text


def imports(text: str) -> list[str]:
    """Return the import statements of ours that a page shows, in blocks and within lines."""
    return [statement.strip() for statement in _IMPORT.findall(text)]


def modules(text: str) -> set[str]:
    """Return the modules of ours that a page names, some with a name in them."""
    return {name for name in _MODULE.findall(text) if not name.endswith((".py", ".md"))}


def files(text: str) -> set[str]:
    """Return the files and folders of the repository that a page names, some with a test in them (FILE::NAME)."""
    return set(_FILE.findall(text))


def prose(text: str) -> str:
    """Return a page without code, in which no link or heading is meant."""
    text = _FENCE.sub("", text)
    return re.sub(r"`[^`\n]*`", "``", re.sub(r"(?m)^(    |\t).*$", "", text))


def saved_files(page: Path) -> set[str]:
    """Return the files that a reader is told to write."""
    return set(re.findall(r"[Ss]ave (?:this|it)(?: \w+)? as\s+`([^`]+)`", page.read_text(encoding="utf-8")))


def adds_fields(page: Path) -> bool:
    """Return whether a reader is told to write a module, or to declare a field, which scenarios then have."""
    declared = re.search(r"(?m)^ +\w+: .* = quantity\($", page.read_text(encoding="utf-8"))
    return bool(declared) or any(name.endswith(".py") for name in saved_files(page))


def links(text: str) -> list[str]:
    """Return where a page's links and pictures lead, but for those to other sites."""
    return [target for target in _LINK.findall(prose(text)) if not re.match(r"https?:|mailto:", target)]


def anchors(text: str) -> set[str]:
    """Return the names of a page's headings, as GitHub and MyST make them."""
    headings = re.findall(r"(?m)^#+ +(.*?) *$", _FENCE.sub("", text))
    plain = (re.sub(r"\[([^\]]*)\]\([^)]*\)|[`*]", r"\1", heading) for heading in headings)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in plain}


def code(text: str) -> Iterator[str]:
    """Yield the blocks of commands: fenced ones without a language or in sh, and indented ones."""
    yield from fences(text, "", "sh")
    for block in re.findall(r"(?m)(?:^ {4}.*\n)+", _FENCE.sub("", text)):
        yield re.sub(r"(?m)^ {4}", "", block)


def commands(text: str, program: str) -> Iterator[list[str]]:
    """Yield the words of each command line of a page that begins with a program, without comments and redirections."""
    for block in code(text):
        lines = re.sub(r"\\\n\s*", " ", block).splitlines()
        typed = [line[2:] for line in lines if line.startswith("$ ")]  # the others are then what the command prints
        for line in typed or lines:
            if re.match(rf"{re.escape(program)}(\s|$)", line):
                words = shlex.split(line, comments=True)
                end = next((n for n, word in enumerate(words) if word in _SHELL), len(words))
                yield words[:end]
