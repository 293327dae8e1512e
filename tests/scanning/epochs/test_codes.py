"""The codes of changes in clouds: the page for users lists all of them, once, and says what each is elsewhere."""

from __future__ import annotations

import re
from pathlib import Path

from synthroads_addon.scanning.epochs.truth import CODES

PAGE = (Path(__file__).parents[3] / "docs" / "epochs.md").read_text(encoding="utf-8")


def test_the_page_lists_every_code() -> None:
    rows = re.findall(r"^\| (\d+) \| (\w+) \|", PAGE, flags=re.MULTILINE)
    assert [(name, int(code)) for code, name in rows] == list(CODES.items())


def test_every_kind_has_a_class_of_other_data_sets() -> None:
    table = PAGE.partition("### Classes of other data sets")[2].partition("\n## ")[0]
    names = [
        name for row in re.findall(r"^\| ([a-z_, ]+) \|", table, flags=re.MULTILINE)[1:] for name in row.split(", ")
    ]
    assert sorted(names) == sorted(CODES)
