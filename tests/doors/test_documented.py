"""Every line that users are shown is in the table of small sizes; the session `doors` runs them by that table."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from tests.doors.documented import PAGES, ROOT, Documented, blocks, documented_lines
from tests.doors.inputs import INPUTS, MADE_FROM
from tests.doors.run_documented import Step, paths_of, refusal_fault, rows_of
from tests.doors.small_sizes import EXTRAS, ROWS, Small

LINES = documented_lines()


def test_every_line_has_a_row_and_every_row_a_line() -> None:
    assert {line.key for line, row in rows_of(LINES) if row} == {row.text for row in ROWS}


def test_a_line_without_a_row_is_a_failure() -> None:
    new = Documented("README.md", 1, "command", "synthroads list devices --jsn")
    with pytest.raises(ValueError, match=r"1 lines without a row .*README.md:1: synthroads list devices --jsn"):
        rows_of([*LINES, new])


def test_a_line_that_has_changed_is_a_failure() -> None:
    changed = [replace(one, text=one.text.replace("--seed 7", "--sead 7")) for one in LINES]
    with pytest.raises(ValueError, match=r"--sead 7.* rows without a line: .*--seed 7"):
        rows_of(changed)


def test_a_row_without_a_line_is_a_failure() -> None:
    with pytest.raises(ValueError, match="1 rows without a line: synthroads list devices"):
        rows_of([line for line in LINES if line.text != "synthroads list devices"])


def test_what_is_run_is_the_line_with_small_numbers() -> None:
    """A word to be replaced that a page no longer has raises."""
    for line, row in rows_of(LINES):
        if row:
            assert row.command(line.text)
            assert not (row.reason and (row.more or row.instead or row.needs or row.inputs)), line
            assert set(row.inputs) <= set(INPUTS)
            assert row.needs <= set(EXTRAS)


def test_a_line_waits_for_those_that_write_what_it_names() -> None:
    rows = {line.key: paths_of(line, row) for line, row in rows_of(LINES) if row and not row.reason}
    steps = [Step(lambda: None, *paths) for paths in rows.values()]
    names = list(rows)

    def waits(line: str, earlier: str) -> bool:
        later, first = (next(n for n, name in enumerate(names) if name.startswith(text)) for text in (line, earlier))
        return steps[later].waits_for(steps[first])

    assert rows["synthroads cloud info out/mine/cloud.laz"] == ({"out/mine/cloud.laz"}, set())
    assert waits("synthroads cloud info out/mine", "synthroads generate --scenario rq31-600m --output out/mine")
    assert waits("synthroads experiment gantries", "synthroads dataset standin")
    assert waits("synthroads experiment gantries", "synthroads dataset reference")
    assert waits("synthroads dataset two-scanners.yaml --output out/two-scanners --verify", "synthroads dataset two-sc")
    assert not waits("synthroads generate --output out/wide", "synthroads generate --scenario rq31-600m --output out/m")
    assert not waits("synthroads check out/mine", "synthroads cloud info out/mine")
    alone = Step(lambda: None, alone=True)
    assert alone.waits_for(steps[0])
    assert steps[0].waits_for(alone)


@pytest.mark.parametrize("again", [False, True])
def test_what_a_line_reads_is_written_by_one_before_it(again: bool) -> None:
    """Else it would be run before what it waits for, or beside it; also of the lines that are run on both releases."""
    written = set(INPUTS)
    for line, row in rows_of(LINES):
        if line.kind == "file":
            written.add(line.name)
        elif row and not row.reason and (row.both or not again):
            reads, writes = paths_of(line, row)
            reads |= {path for name in row.inputs for path in MADE_FROM.get(name, ())}
            tops = {"/".join(path.split("/")[:2]) for path in reads}
            assert tops <= written, line
            written |= writes


def test_words_that_are_replaced_must_be_there() -> None:
    assert (
        Small("synthroads list", "--json", {"list": "check"}).command("synthroads list a")
        == "synthroads check a --json"
    )
    with pytest.raises(ValueError, match="c is to be replaced and isn't there"):
        Small("synthroads list", "", {"c": ""}).command("synthroads list a")


def test_the_extras_are_those_of_the_project() -> None:
    offered = set(
        tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    )
    assert offered - {"blender", "dev", "docs", "faults", "judges"} == set(EXTRAS)


def test_lines_within_a_paragraph_or_list_are_no_block() -> None:
    assert list(blocks("Text\n    continued\n\n- item\n    continued\n")) == []


def test_lines_are_read_with_place_and_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.doors.documented.ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "Text\n\n    $ synthroads list 'a # b'   # why\n    b\n\n    c\n\n    $ make demo\n\n"
        "```python\nimport json\nprint(1)\n```\n\n    1\n\nSave it as `x.yaml`:\n\n```yaml\na: 1\n```\n"
    )
    assert documented_lines([page]) == [
        Documented("page.md", 3, "command", "synthroads list 'a # b'", ("b", "", "c"), 4),
        Documented("page.md", 8, "command", "make demo"),
        Documented("page.md", 11, "python", "import json\nprint(1)", ("1",), 15),
        Documented("page.md", 20, "file", "a: 1", name="x.yaml"),
    ]


@pytest.mark.parametrize("line", ["sinthroads list", "curl https://example.org", "synthroads list \\"])
def test_a_line_of_no_known_program_is_a_failure(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.doors.documented.ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"Text\n\n    synthroads list\n    {line}\n")
    with pytest.raises(ValueError, match=r"page\.md:4: "):
        documented_lines([page])


def test_every_page_has_lines() -> None:
    assert {line.page for line in LINES} == {page.relative_to(ROOT).as_posix() for page in PAGES}


@pytest.mark.parametrize(
    ("code", "errors", "fault"),
    [
        (2, "error: the package torch is missing: pip install 'synthroads[ml]'", ""),
        (2, "error: needs PyTorch: pip install -e '.[onnx,ml]' in the repository", ""),
        (1, "error: the package torch is missing: pip install 'synthroads[ml]'", "exit code 1 instead of 2"),
        (2, "error: the package torch is missing", "doesn't say how to install ml"),
        (2, "error: needs it: pip install 'synthroads[twin]'", "doesn't say how to install ml"),
        (2, "reading: 10 %\nerror: needs it: pip install 'synthroads[ml]'", "2 lines on standard error"),
    ],
)
def test_refusals_name_the_extra_in_one_line(code: int, errors: str, fault: str) -> None:
    found = refusal_fault(code, errors, ["ml"])
    assert fault in found
    assert bool(fault) == bool(found)
