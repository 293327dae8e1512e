"""The command lines, snippets and files that README, tasks, start, tutorials, guides and the page on Python show.

It needs nothing but Python itself: environments as users make them hold none of the tests' packages.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

ROOT = Path(__file__).resolve().parents[2]
GUIDES = (
    *("first-cloud", "own-scanner", "own-scene", "data-set", "train"),
    *("label", "scan-to-twin", "compare", "blender", "cluster"),
)
PAGES = (
    ROOT / "README.md",
    ROOT / "docs" / "tasks.md",
    ROOT / "docs" / "start.md",
    ROOT / "docs" / "tutorials" / "data-engineer.md",
    ROOT / "docs" / "tutorials" / "modeller.md",
    ROOT / "docs" / "tutorials" / "researcher.md",
    *(ROOT / "docs" / "guide" / f"{name}.md" for name in GUIDES),
    ROOT / "docs" / "reference" / "python.md",
)
"""In the order in which a user reads them: later ones use what was made in earlier ones."""

_PROGRAM = re.compile(r"^(\.|synthroads|python|blender|pip|make|nox|[A-Z_]+=\S+ make)(\s|$)")
_FENCE = re.compile(r"^(```+)(\S*)")
_SAVED = re.compile(r"[Ss]ave (?:this|it)(?: \w+)? as\s+`([^`]+)`")
_SHELLS = ("", "sh")


@dataclass(frozen=True)
class Block:
    """A block of code of a page.

    Attributes:
        line: number of its first line, from 1.
        language: what its fence says; None for an indented block.
        lines: without fences and indentation.
        before: the paragraph's text before it.
    """

    line: int
    language: str | None
    lines: tuple[str, ...]
    before: str


@dataclass(frozen=True)
class Documented:
    """Something that a page tells its reader to type, to run or to save.

    Attributes:
        page: path of the page from the repository's root.
        line: number of its first line there, from 1.
        kind: ``command`` is a line for a shell, ``python`` a whole snippet, ``file`` what is to be saved.
        text: what stands there, a command without ``$`` and without the comment behind it.
        shown: lines of output that the page shows for it.
        output: number of the first line of that output; 0 without any.
        name: of a file.
    """

    page: str
    line: int
    kind: Literal["command", "python", "file"]
    text: str
    shown: tuple[str, ...] = ()
    output: int = 0
    name: str = ""

    @property
    def key(self) -> str:
        """Return its first line."""
        return self.text.partition("\n")[0]

    def __str__(self) -> str:
        """Return place and first line."""
        return f"{self.page}:{self.line}: {self.key}"


def documented_lines(pages: Sequence[Path] = PAGES) -> list[Documented]:
    """Return all that pages tell their readers to type, to run or to save, in their order.

    Raises:
        ValueError: a line in a block of commands begins with no program that is known here.
    """
    return [found for page in pages for found in _of_page(page.relative_to(ROOT).as_posix(), page.read_text("utf-8"))]


def blocks(text: str) -> Iterator[Block]:
    """Yield the blocks of code of a page's text, fenced and indented ones."""
    lines, number, paragraph, before = text.splitlines(), 0, "", ""
    while number < len(lines):
        start, line = number, lines[number]
        if fence := _FENCE.match(line):
            number = next(n for n in range(start + 1, len(lines)) if lines[n] == fence[1])
            yield Block(start + 2, fence[2], tuple(lines[start + 1 : number]), before)
            paragraph = before = ""
        elif line.startswith("    ") and not paragraph:
            number = _end_of_indented(lines, start)
            yield Block(start + 1, None, tuple(line[4:] for line in lines[start : number + 1]), before)
            before = ""
        elif line.strip():
            paragraph = before = f"{paragraph} {line}".strip()
        else:
            paragraph = ""
        number += 1


def _end_of_indented(lines: list[str], start: int) -> int:
    """Return the number of the last line of an indented block, which may hold empty lines."""
    end = start
    for number in range(start, len(lines)):
        if lines[number].startswith("    "):
            end = number
        elif lines[number].strip():
            break
    return end


def _of_page(page: str, text: str) -> Iterator[Documented]:
    """Yield what a page tells its reader to type, to run or to save."""
    waiting: Documented | None = None  # the snippet whose output the next block may be
    for block in blocks(text):
        typed = block.language in (*_SHELLS, None)
        if waiting is not None:
            output = typed and not any(_PROGRAM.match(line.removeprefix("$ ")) for line in block.lines)
            yield replace(waiting, shown=block.lines, output=block.line) if output else waiting
            waiting, typed = None, typed and not output
        if typed:
            yield from _commands(page, block)
        elif block.language == "python":
            waiting = Documented(page, block.line, "python", "\n".join(block.lines))
        elif saved := _SAVED.search(block.before):
            yield Documented(page, block.line, "file", "\n".join(block.lines), name=saved[1])
    if waiting is not None:
        yield waiting


def _commands(page: str, block: Block) -> Iterator[Documented]:
    """Yield the commands of a block, each with the output below it where typed lines begin with ``$``."""
    prompts = any(line.startswith("$ ") for line in block.lines)
    starts = [n for n, line in enumerate(block.lines) if (line.startswith("$ ") if prompts else line.strip())]
    for start, end in zip(starts, [*starts[1:], len(block.lines)], strict=True):
        line = block.lines[start].removeprefix("$ ")
        place = f"{page}:{block.line + start}"
        if not _PROGRAM.match(line):
            raise ValueError(f"{place}: no program that is known here: {line}")
        if line.endswith("\\"):
            raise ValueError(f"{place}: a command over two lines is not read here: {line}")
        shown = block.lines[start + 1 : end]
        while shown and not shown[-1]:
            shown = shown[:-1]
        output = block.line + start + 1 if shown else 0
        yield Documented(page, block.line + start, "command", _without_comment(line), shown, output)


def _without_comment(line: str) -> str:
    """Return a command line as it is written, without the comment behind it."""
    words = shlex.split(line, comments=True)
    return next(
        shorter
        for end in range(len(line) + 1)
        if (shorter := line[:end]) == shorter.rstrip() and _words(shorter) == words
    )


def _words(line: str) -> list[str] | None:
    """Return a command line's words; None where a quotation isn't closed."""
    try:
        return shlex.split(line)
    except ValueError:
        return None
