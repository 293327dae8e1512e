"""The button that shows Blender the library of node groups: it changes the preferences when it is pressed, and once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

import synthroads_addon
from synthroads_addon.ui.fields import preferences


@pytest.fixture
def libraries() -> Iterator[Any]:
    """Register the add-on; return Blender's asset libraries, which are as before afterwards."""
    known = bpy.context.preferences.filepaths.asset_libraries
    before = [library.name for library in known]
    synthroads_addon.register()
    assert [library.name for library in known] == before, "registering changes no preferences"
    yield known
    synthroads_addon.unregister()
    for library in [library for library in known if library.name not in before]:
        known.remove(library)


def test_the_library_is_added_once(libraries: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preferences, "LIBRARY_FOLDER", tmp_path)
    assert not bpy.ops.synthroads.add_asset_library.poll()  # a checkout has none
    (tmp_path / preferences.LIBRARY_FILE).write_bytes(b"")
    before = len(libraries)
    assert bpy.ops.synthroads.add_asset_library() == {"FINISHED"}
    assert len(libraries) == before + 1
    assert (libraries[-1].name, Path(libraries[-1].path)) == (preferences.LIBRARY_NAME, tmp_path)
    assert not bpy.ops.synthroads.add_asset_library.poll()
