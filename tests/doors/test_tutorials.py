"""The tutorials show what their lines print: `python tools/run_tutorials.py` puts it there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.doors.documented import ROOT, Documented, documented_lines
from tools import run_tutorials
from tools.run_tutorials import FIGURES, Figure, renewed, with_figures, with_outputs


def shown(text: str, *lines: str) -> Documented:
    """Return a documented command with what a page shows of its output."""
    return Documented("page.md", 1, "command", text, lines, 2)


@pytest.mark.parametrize(
    ("text", "old", "new"),
    [
        ("synthroads generate", "  scan       4.68 s   peak     770 MB", "  scan      14.2 s   peak     1,070 MB"),
        (
            "synthroads predict",
            "points 8.3e+05, seconds 4.9, peak_memory_mb 4.4",
            "points 8.3e+05, seconds 9, peak_memory_mb 5",
        ),
        ("synthroads train segmentation", "iou 0.8473, peak_memory_mb 541.4", "iou 0.8512, peak_memory_mb 600.0"),
        ("synthroads evaluate run", "road  95.9  96.4  92.6    360,337", "road    94.9  96.4  93.0  360,337"),
    ],
)
def test_the_machines_figures_are_left_as_they_are(text: str, old: str, new: str) -> None:
    line = shown(text, old)
    assert renewed(line, [new]) == (old,)


@pytest.mark.parametrize(
    ("text", "old", "new"),
    [
        ("synthroads generate", "836,929 points from 2,999,000 pulses", "834,786 points from 2,999,000 pulses"),
        ("synthroads predict", "points 8.369e+05, seconds 4.9", "points 8.348e+05, seconds 4.9"),
        ("synthroads train segmentation", "iou 0.8473, peak_memory_mb 541.4", "iou 0.8211, peak_memory_mb 541.4"),
        ("synthroads evaluate run", "road  95.9  96.4  92.6    360,337", "road  95.9  96.4  90.1    360,337"),
        ("synthroads evaluate run", "road  95.9  96.4  92.6    360,337", "road  95.9  96.4  92.6    360,338"),
        ("synthroads cloud info", "all  112.8  178.84", "all  112.8  178.85"),
    ],
)
def test_other_figures_are_made_anew(text: str, old: str, new: str) -> None:
    assert renewed(shown(text, old), [new]) == (new,)


def test_lines_that_are_left_out_stay_so() -> None:
    line = shown("synthroads list", "a", "...", "c")
    assert renewed(line, ["a", "b", "c"]) == ("a", "...", "c")
    assert renewed(line, ["b", "b", "d"]) == ("b", "...", "d")
    assert renewed(shown("synthroads list", "a"), ["a", "b"]) == ("a", "b")


def test_rows_that_are_new_come_among_those_that_stay() -> None:
    line = shown("synthroads generate", "836,929 points", "  scan  4.68 s", "  in all  11.22 s")
    new = renewed(line, ["834,786 points", "  scan  9.1 s", "  files  3.10 s", "  in all  20.0 s"])
    assert new == ("834,786 points", "  scan  4.68 s", "  files  3.10 s", "  in all  11.22 s")


def test_a_line_is_not_run_again_in_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_tutorials, "_run", lambda folder, words: "a\nb")
    line = shown("synthroads list", "a")
    assert list(run_tutorials.run_lines([line], tmp_path)) == [(line, ["a", "b"])]
    monkeypatch.setattr(run_tutorials, "_run", lambda folder, words: pytest.fail("it is run again"))
    assert list(run_tutorials.run_lines([line], tmp_path)) == [(line, ["a", "b"])]


def test_outputs_are_put_where_they_stood() -> None:
    text = "Text\n\n    $ synthroads list\n    a\n    b\n    $ synthroads check\n    c\n\nMore\n"
    first = Documented("page.md", 3, "command", "synthroads list", ("a", "b"), 4)
    second = Documented("page.md", 6, "command", "synthroads check", ("c",), 7)
    new = with_outputs(text, [(first, ["x"]), (second, ["y", "", "z"])])
    assert new == "Text\n\n    $ synthroads list\n    x\n    $ synthroads check\n    y\n\n    z\n\nMore\n"


def test_figures_in_sentences_are_made_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        run_tutorials, "FIGURES", (Figure("page.md", r"some ([\d.]+) million points", lambda _: "8.9"),)
    )
    assert with_figures("page.md", "has some 8.8\nmillion points", Path()) == "has some 8.9\nmillion points"
    with pytest.raises(ValueError, match="nothing there like some"):
        with_figures("page.md", "has points", Path())


@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.pattern)
def test_every_figure_has_its_place(figure: Figure) -> None:
    text = (ROOT / figure.page).read_text(encoding="utf-8")
    assert len(re.findall(figure.pattern, text.replace("\n", " "))) == 1


def test_every_output_is_that_of_a_line_that_is_run() -> None:
    """Only commands of ours and snippets have an output that is compared."""
    assert len([line for line in documented_lines() if line.shown]) >= 9
    assert all(
        line.text.startswith("synthroads ") for line in documented_lines() if line.shown and line.kind != "python"
    )


@pytest.mark.slow
@pytest.mark.first_python
def test_the_tutorials_show_what_their_lines_print() -> None:
    call = [sys.executable, str(ROOT / "tools" / "run_tutorials.py"), "--check"]
    answer = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stdout + answer.stderr
