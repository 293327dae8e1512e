"""Run the lines of the tutorials as they stand there, and put what they print into the pages.

    python tools/run_tutorials.py                     # writes what has changed into the pages
    python tools/run_tutorials.py --check             # only compares: fails if a page isn't what its lines print
    python tools/run_tutorials.py --folder out/tour   # keeps what the lines write; goes on where it was stopped
    python tools/run_tutorials.py --until data-engineer    # leaves out the pages behind that one, which train

A line is run where a page shows what it prints; the demo and a road in Blender are made as well, for the figures that
stand in sentences (`FIGURES`). It takes a quarter of an hour on two cores. Seconds, memory and speed are the machine's:
a page keeps those that it has. So may the scores of a training be, within `SCORES`: other processors round otherwise.
"""

from __future__ import annotations

import argparse
import difflib
import hashlib
import json
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.doors.documented import PAGES, ROOT, Documented, documented_lines

SCORES = 0.02
"""Difference of a training's scores, as a share of 1, that is still the same result."""
_LEARNED = ("synthroads train", "synthroads evaluate")
_PRINTED = ".printed"
_GAP = "..."
"""A line of a page that stands for lines which it doesn't show."""
_MACHINE = re.compile(
    r"\b\d[\d.,]*(?:e[+-]\d+)? +(?=MB\b|s\b)|(?<=seconds )[\d.e+]+|(?<=points_per_second )[\d.e+]+"
    r"|(?<=peak_memory_mb )[\d.e+]+"
)
"""Figures that are the machine's."""
_SCORE = re.compile(r"(?<![\d,.])\d+\.\d+(?!\d|,\d|e)")
_PICTURES = {"out/scores/small-roads-test.png": "docs/pictures/tutorial-segmentation.png"}
"""File that a line writes -> the picture of it in the documentation."""


@dataclass(frozen=True)
class Figure:
    """A figure in a sentence of a page.

    Attributes:
        page: path from the repository's root.
        pattern: what stands before and behind the figure, with the figure in a group of its own.
        value: returns what the figure must be, given the folder that all lines were run in.
    """

    page: str
    pattern: str
    value: Callable[[Path], str]


_DEMO = ["-m", "headless.generate", "--scenario", "rq31-600m", "--output", "out/demo"]
"""Arguments of the command that `make demo` runs."""
_WIDER_LANE = """
import bpy, synthroads_addon
from synthroads_addon.blender.compat import set_modifier_input
synthroads_addon.register()
settings = bpy.context.scene.synthroads
settings.fidelity, settings.road.length, settings.seed = "draft", 300, 3
bpy.ops.synthroads.build()
found = bpy.context.window_manager.synthroads_rules.violations
bpy.ops.synthroads.check_rules()
before = len(found)
set_modifier_input(bpy.data.objects["Road"].modifiers[0], "Right Lane 1 Width", 4.5)
bpy.data.objects["Road"].update_tag()
bpy.context.view_layer.update()
bpy.ops.synthroads.check_rules()
print("\\nbroken:", before, len(found))
"""
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def demo_points(folder: Path) -> str:
    """Return the points of the demo's cloud in millions."""
    report = json.loads((folder / "out/demo/report.json").read_text(encoding="utf-8"))
    return f"{report['counts']['points'] / 1e6:.1f}"


def broken_rules(before_or_after: int) -> Callable[[Path], str]:
    """Return what says how many rules a road of 300 m breaks before (0) and after (1) a lane was made 4.5 m wide."""

    def value(folder: Path) -> str:
        """Return the number of broken rules in words; Blender counts them once for each folder."""
        output = _once(folder, _WIDER_LANE, [sys.executable, "-c", _WIDER_LANE])
        return _NUMBERS[int(output.split("broken:")[1].split()[before_or_after])]

    return value


FIGURES = (
    Figure("README.md", r"`cloud\.laz` \| about ([\d.]+) million points", demo_points),
    Figure("docs/start.md", r"`cloud\.laz` with about ([\d.]+) million labelled\s+points", demo_points),
    Figure("docs/tutorials/modeller.md", r"that the road breaks: at (\w+) places", broken_rules(1)),
    Figure("docs/tutorials/modeller.md", r"Before the change, (\w+) rules? (?:was|were) broken", broken_rules(0)),
)


def run_lines(lines: Sequence[Documented], folder: Path) -> Iterator[tuple[Documented, list[str]]]:
    """Run in a folder each line whose output is shown, and yield it with the lines that it prints.

    A line that was run in the folder before isn't run again: what it printed lies in the folder's `_PRINTED`.
    """
    for line in lines:
        if line.kind == "file":
            (folder / line.name).write_text(line.text + "\n", encoding="utf-8")
        elif line.shown:
            yield line, _once(folder, line.text, _words(line)).splitlines()


def _once(folder: Path, text: str, words: Sequence[str]) -> str:
    """Return what a command prints in a folder; where it was run there before, what it printed then."""
    file = folder / _PRINTED / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.txt"
    if not file.exists():
        print(f"{text.strip().splitlines()[0]} ...", flush=True)
        output = _run(folder, words)
        file.parent.mkdir(exist_ok=True)
        file.write_text(output, encoding="utf-8")
    return file.read_text(encoding="utf-8")


def _words(line: Documented) -> list[str]:
    """Return the words of a line, its program by this environment's path."""
    if line.kind == "python":
        return [sys.executable, "-c", line.text]
    program, *rest = shlex.split(line.text)
    return [str(Path(sys.executable).parent / program), *rest]


def _run(folder: Path, words: Sequence[str]) -> str:
    """Run a command in a folder and return what it prints; RuntimeError if it fails."""
    answer = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    if answer.returncode:
        raise RuntimeError(f"{' '.join(words)}: exit code {answer.returncode}\n{answer.stdout}{answer.stderr}")
    return answer.stdout.rstrip("\n")


def renewed(line: Documented, printed_lines: Sequence[str]) -> tuple[str, ...]:
    """Return what a page should show of what a line printed: what it shows, where that is the same."""
    shown_lines = line.shown
    gap_number = shown_lines.index(_GAP) if _GAP in shown_lines else None
    shortened_lines = gap_number is not None and (
        *printed_lines[:gap_number],
        _GAP,
        *printed_lines[len(printed_lines) - (len(shown_lines) - gap_number - 1) :],
    )
    new_lines = shortened_lines or tuple(printed_lines)
    if len(shown_lines) == len(new_lines) and all(map(_same(line.text.startswith(_LEARNED)), shown_lines, new_lines)):
        return shown_lines
    are_same = _same(is_learned=False)
    return tuple(
        next((shown_line for shown_line in shown_lines if are_same(shown_line, row)), row) for row in new_lines
    )


def _same(is_learned: bool) -> Callable[[str, str], bool]:
    """Return what says whether two lines are the same, but for the machine's figures and scores a little apart."""

    def same(shown_line: str, printed_line: str) -> bool:
        """Return whether two lines say the same."""
        shown_line, printed_line = (_MACHINE.sub("#", line) for line in (shown_line, printed_line))
        if not is_learned:
            return _spaced(shown_line) == _spaced(printed_line)
        pairs = list(zip(_SCORE.findall(shown_line), _SCORE.findall(printed_line), strict=False))
        largest = 100.0 if any(float(number) > 1.0 for pair in pairs for number in pair) else 1.0
        are_near = all(abs(float(a) - float(b)) <= SCORES * largest for a, b in pairs)
        return are_near and _spaced(_SCORE.sub("#", shown_line)) == _spaced(_SCORE.sub("#", printed_line))

    return same


def _spaced(line: str) -> str:
    """Return a line with single spaces, as columns are as wide as the machine's figures."""
    return " ".join(line.split())


def with_outputs(text: str, outputs: Sequence[tuple[Documented, Sequence[str]]]) -> str:
    """Return a page's text with the outputs of its lines replaced; they stand in indented blocks."""
    lines = text.splitlines()
    for line, new_lines in sorted(outputs, key=lambda pair: -pair[0].output):
        first_number = line.output - 1
        lines[first_number : first_number + len(line.shown)] = [f"    {row}".rstrip() for row in new_lines]
    return "\n".join(lines) + "\n"


def with_figures(page: str, text: str, folder: Path) -> str:
    """Return a page's text with the figures in its sentences made anew; ValueError where one has no place."""
    for figure in FIGURES:
        if figure.page == page:
            match = re.search(figure.pattern, " ".join(text.split("\n")))
            if not match:
                raise ValueError(f"{page}: nothing there like {figure.pattern}")
            text = text[: match.start(1)] + figure.value(folder) + text[match.end(1) :]
    return text


def pages_anew(folder: Path, pages: Sequence[Path] = PAGES) -> dict[Path, str]:
    """Run in a folder all that pages show, and return those that change with their new text."""
    outputs: dict[str, list[tuple[Documented, Sequence[str]]]] = {
        page.relative_to(ROOT).as_posix(): [] for page in pages
    }
    _once(folder, " ".join(_DEMO), [sys.executable, *_DEMO])
    for line, printed_lines in run_lines(documented_lines(pages), folder):
        outputs[line.page].append((line, renewed(line, printed_lines)))
    new_texts = {}
    for page, rows in outputs.items():
        old_text = (ROOT / page).read_text(encoding="utf-8")
        new_text = with_figures(page, with_outputs(old_text, rows), folder)
        if new_text != old_text:
            new_texts[ROOT / page] = new_text
    return new_texts


def main() -> int:
    """Write the pages anew, or with ``--check`` say which lines of them would change and return 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing: fail if a page would change")
    text = "folder for what the lines write, and for going on (one that is removed)"
    parser.add_argument("--folder", type=Path, metavar="DIR", help=text)
    text = "leave out the pages behind this one (the last)"
    parser.add_argument("--until", choices=[page.stem for page in PAGES], default=PAGES[-1].stem, help=text)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="synthroads-") as scratch:
        folder = arguments.folder.absolute() if arguments.folder else Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        names = [page.stem for page in PAGES]
        new_texts = pages_anew(folder, PAGES[: names.index(arguments.until) + 1])
        for path, text in new_texts.items():
            print(f"{path.relative_to(ROOT)}: {'is not what its lines print' if arguments.check else 'written'}")
            print("\n".join(_difference(path.read_text(encoding="utf-8"), text)))
            if not arguments.check:
                path.write_text(text, encoding="utf-8")
        if new_texts and not arguments.check:
            for file, picture in _PICTURES.items():
                if (folder / file).exists():
                    (ROOT / picture).write_bytes((folder / file).read_bytes())
    return 1 if arguments.check and new_texts else 0


def _difference(old_text: str, new_text: str) -> Iterator[str]:
    """Yield the lines that differ between two texts."""
    yield from difflib.unified_diff(old_text.splitlines(), new_text.splitlines(), "page", "printed", lineterm="", n=0)


if __name__ == "__main__":
    sys.exit(main())
