"""How many entries of folders are listed in the search for what killed processes left."""

from pathlib import Path

import pytest

from synthroads_addon.base.scratch import folders


def listed_entries(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list to which each search for leftovers adds the number of entries that it listed."""
    listed: list[int] = []
    look_through = folders.remove_leftovers

    def remove_leftovers(parent: Path) -> int:
        listed.append(look_through(parent))
        return listed[-1]

    monkeypatch.setattr(folders, "remove_leftovers", remove_leftovers)
    return listed
