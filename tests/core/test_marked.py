"""Documents whose tables are filled by commands."""

from __future__ import annotations

import pytest

from synthroads_addon.core.errors import InputError
from synthroads_addon.core.marked import replaced


def test_only_what_stands_between_markers_is_replaced() -> None:
    document = (
        "before\n<!-- table: a -->\nold\n<!-- end of table -->\nbetween\n<!-- table: b -->\n<!-- end of table -->\n"
    )
    new = replaced(document, {"b": "| new |\n"})
    assert new == document.replace("<!-- table: b -->\n", "<!-- table: b -->\n| new |\n")
    assert replaced(new, {"b": "| new |\n"}) == new
    with pytest.raises(InputError, match="table: c"):
        replaced(document, {"c": ""})
