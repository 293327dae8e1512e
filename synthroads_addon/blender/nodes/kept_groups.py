"""Node groups kept between processes: Blender takes seconds to make those of a road, and a fifth of one to read them.

Each node that is added has Blender work out the whole tree anew. A build of a road therefore keeps the groups that it
has made in a .blend file in the user's folder of Blender, and later builds, in any process, read them from it. A group
is known by the hash of what it is made from (`builder.KEY`), the file by Blender's version and the place of the
package. A list beside it says which groups the last roads needed, so that a build reads those of a road like its own.
`SYNTHROADS_KEEP_GROUPS=off` in the environment keeps and reads none.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import bpy

KEY = "synthroads_key"
"""Custom property of a group: hash of what it was built from."""
VARIABLE = "SYNTHROADS_KEEP_GROUPS"
"""Environment variable that is ``off`` where no groups are to be kept."""
ROADS = 8
"""Roads whose groups are kept, the latest. Chosen: the shipped scenarios, and some of the user's own."""
_NEW_SHARE = 0.2
"""Share of a road's groups that must be new for it to replace one of `ROADS`. Chosen: to write takes as long."""
_EXTENSION = "bl_ext."
"""Beginning of the name of a package that Blender runs as an extension."""
_SUFFIX = re.compile(r"( \(older\))?(\.[0-9]{3,})?$")
"""End of a group's name in a file that has or had another group of that name."""


class _State:
    made = 0


def kept_file() -> Path | None:
    """Return the .blend file of kept groups, be it there or not; None if none are kept."""
    if os.environ.get(VARIABLE) == "off":
        return None
    if __package__.startswith(_EXTENSION):
        folder = bpy.utils.extension_path_user(".".join(__package__.split(".")[:3]), path="node-groups")
    else:
        folder = str(Path(bpy.utils.user_resource("DATAFILES")) / "synthroads" / "node-groups")
    build = (bpy.app.version_string, bpy.app.build_hash, str(Path(__file__).resolve()))
    digest = hashlib.sha256(repr(build).encode()).hexdigest()[:12]
    return Path(folder) / f"{digest}.blend"


def note_made() -> None:
    """Note that a group was made that the file of kept groups lacks."""
    _State.made += 1


def take_kept_group(key: str) -> bpy.types.NodeTree | None:
    """Return the kept group of a key, put into the open file with the others of a road that had it; None without one.

    Of several roads it is the one with the fewest groups.
    """
    file = kept_file()
    roads = [road for road in _kept_roads(file) if key in road]
    if file is None or not roads:
        return None
    _read(file, min(roads, key=len))
    return next((group for group in bpy.data.node_groups if group.get(KEY) == key), None)


def may_keep_groups() -> bool:
    """Return whether the groups that a build makes from here on may be kept: the file holds none of the project's yet.

    A user can have edited those.
    """
    return not any(KEY in group for group in bpy.data.node_groups)


def keep_groups() -> None:
    """Write the groups of the open file's road, and those kept of others, to the file of kept groups, if any is new.

    Without a word where that can't be written: they are made anew then.
    """
    file, made, _State.made = kept_file(), _State.made, 0
    road = {group[KEY]: group.name for group in bpy.data.node_groups if KEY in group and group.users}
    roads = _kept_roads(file)
    if file is None or not made or (len(roads) >= ROADS and made < _NEW_SHARE * len(road)):
        return
    roads = [road, *roads][:ROADS]
    _read(file, {key: name for kept in roads[1:] for key, name in kept.items()})
    groups = {group[KEY]: group for group in bpy.data.node_groups if KEY in group}
    roads = [{key: groups[key].name for key in kept} for kept in roads if kept.keys() <= groups.keys()]
    contents = {groups[key] for kept in roads for key in kept}
    with suppress(OSError, RuntimeError):
        _write(file, contents, roads)


def _write(file: Path, groups: set[bpy.types.NodeTree], roads: list[dict[str, str]]) -> None:
    """Write groups and the list of roads; a process that reads meanwhile has one of both files of before at worst."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=file.parent) as text:
        part, index = Path(text) / file.name, Path(text) / "index"
        bpy.data.libraries.write(str(part), groups, fake_user=False, compress=True)
        index.write_text(json.dumps({"made_by": _stamp(), "roads": roads}), encoding="utf-8")
        part.replace(file)
        index.replace(file.with_suffix(".json"))


def _read(file: Path, wanted: dict[str, str]) -> None:
    """Put kept groups, names in the file by key, into the open file, but for those that it has."""
    groups = bpy.data.node_groups
    there = {group[KEY]: group for group in groups if KEY in group}
    names = {name for key, name in wanted.items() if key not in there}
    before = {group.session_uid for group in groups}
    if not names:
        return
    try:
        with bpy.data.libraries.load(str(file), link=False) as (kept, chosen):
            chosen.node_groups = [name for name in kept.node_groups if name in names]
    except OSError:  # another process has taken it away, or it is no .blend file
        return
    bpy.data.libraries.remove(bpy.data.libraries[file.name])
    for group in [group for group in groups if group.session_uid not in before]:
        if (same := there.get(group.get(KEY))) is not None:
            group.user_remap(same)
            groups.remove(group)


def restore_names() -> None:
    """Give the project's groups in the open file their own names back, where no other group has them any more."""
    groups = bpy.data.node_groups
    for group in [group for group in groups if KEY in group]:
        name = _SUFFIX.sub("", group.name)
        if name != group.name and name not in groups:
            group.name = name


def _kept_roads(file: Path | None) -> list[dict[str, str]]:
    """Return the groups of each road that are in the file, names by key; none if other source files made them."""
    if file is None:
        return []
    try:
        index = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
        return [dict(road) for road in index["roads"]] if index["made_by"] == _stamp() else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


@cache
def _stamp() -> str:
    """Return a digest of sizes and times of all source files that work with Blender; cached."""
    blender = Path(__file__).parents[1]
    stats = [(str(path.relative_to(blender)), path.stat()) for path in sorted(blender.rglob("*.py"))]
    text = repr([(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
