"""Documents whose tables are filled by commands."""

from __future__ import annotations

from pathlib import Path

import pytest

from headless.marked_documents import BEGIN, END, put_tables, replace_tables
from synthroads_addon.base.errors import InputError


def test_only_what_stands_between_markers_is_replaced() -> None:
    document = (
        "before\n<!-- table: a -->\nold\n<!-- end of table -->\nbetween\n<!-- table: b -->\n<!-- end of table -->\n"
    )
    new = replace_tables(document, {"b": "| new |\n"})
    assert new == document.replace("<!-- table: b -->\n", "<!-- table: b -->\n| new |\n")
    assert replace_tables(new, {"b": "| new |\n"}) == new
    with pytest.raises(InputError, match="table: c"):
        replace_tables(document, {"c": ""})


def test_a_document_is_looked_at_before_the_work_and_filled_after_it(tmp_path: Path) -> None:
    document = tmp_path / "page.md"
    document.write_text(f"{BEGIN.format('one')}\n{END}\n", encoding="utf-8")
    assert put_tables(document, ["one"], lambda: {"one": "made"}) == {"one": "made"}
    assert "made" in document.read_text(encoding="utf-8")
    assert put_tables(None, ["other"], lambda: {"other": "made"}) == {"other": "made"}
    with pytest.raises(InputError):
        put_tables(document, ["other"], lambda: pytest.fail("worked for nothing"))
    with pytest.raises(InputError, match=r"--document is .*nowhere.md': cannot be read \(No such file"):
        put_tables(tmp_path / "nowhere.md", ["one"], lambda: pytest.fail("worked for nothing"))
