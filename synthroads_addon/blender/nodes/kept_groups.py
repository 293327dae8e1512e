"""Node groups kept between processes: Blender takes seconds to make a road's groups, but 0.2 s to read them.

Blender updates a whole tree whenever a node is added. A build of a road therefore keeps the groups that it has made in
a .blend file in the user's folder of Blender, and later builds, in any process, read them from it. A group is
identified by the hash of its source and arguments (`builder.KEY`), the file by Blender's version and the package's
folder. A list beside the file has the groups of the latest roads, so that a build reads those of a road like its own.
With `SYNTHROADS_KEEP_GROUPS=off` in the environment no groups are kept or read.
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
"""Custom property of a group: hash of its name, arguments and source files."""
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
    """State of this process.

    Attributes:
        made_count: groups made since the last write of the file of kept groups.
    """

    made_count = 0


def kept_file() -> Path | None:
    """Return the path of the .blend file of kept groups, which may not exist yet; None if groups aren't kept."""
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
    """Count a group that was made because the file of kept groups lacks it."""
    _State.made_count += 1


def take_kept_group(key: str) -> bpy.types.NodeTree | None:
    """Return the kept group of a key, read into the open file with the other groups of its road; None if none is kept.

    If several roads have the group, those of the road with the fewest groups are read.
    """
    file = kept_file()
    roads = [road for road in _kept_roads(file) if key in road]
    if file is None or not roads:
        return None
    _read(file, min(roads, key=len))
    return next((group for group in bpy.data.node_groups if group.get(KEY) == key), None)


def may_keep_groups() -> bool:
    """Return whether the groups that the next build makes may be kept: only if the open file has none of the project's.

    A user could have edited existing groups.
    """
    return not any(KEY in group for group in bpy.data.node_groups)


def keep_groups() -> None:
    """Write the groups of the open file's road, and kept groups of other roads, to the file, if any is new.

    A failure to write is ignored: later builds then make the groups again.
    """
    file, made_count, _State.made_count = kept_file(), _State.made_count, 0
    road = {group[KEY]: group.name for group in bpy.data.node_groups if KEY in group and group.users}
    roads = _kept_roads(file)
    if file is None or not made_count or (len(roads) >= ROADS and made_count < _NEW_SHARE * len(road)):
        return
    # The new file has this road's groups and those of the latest other roads, which are read into the open file first.
    roads = [road, *roads][:ROADS]
    _read(file, {key: name for road_groups in roads[1:] for key, name in road_groups.items()})
    groups = {group[KEY]: group for group in bpy.data.node_groups if KEY in group}
    roads = [
        {key: groups[key].name for key in road_groups} for road_groups in roads if road_groups.keys() <= groups.keys()
    ]
    contents = {groups[key] for road_groups in roads for key in road_groups}
    with suppress(OSError, RuntimeError):
        _write(file, contents, roads)


def _write(file: Path, groups: set[bpy.types.NodeTree], roads: list[dict[str, str]]) -> None:
    """Write groups and the list of roads; a process that reads meanwhile may get one of both files as before."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        part_file, index_file = Path(folder) / file.name, Path(folder) / "index"
        bpy.data.libraries.write(str(part_file), groups, fake_user=False, compress=True)
        index_file.write_text(json.dumps({"made_by": _stamp(), "roads": roads}), encoding="utf-8")
        part_file.replace(file)
        index_file.replace(file.with_suffix(".json"))


def _read(file: Path, names_by_key: dict[str, str]) -> None:
    """Read kept groups, given as names in the file by key, into the open file, except groups that it has already."""
    groups = bpy.data.node_groups
    open_groups = {group[KEY]: group for group in groups if KEY in group}
    names = {name for key, name in names_by_key.items() if key not in open_groups}
    earlier_numbers = {group.session_uid for group in groups}
    if not names:
        return
    try:
        with bpy.data.libraries.load(str(file), link=False) as (file_data, loaded_data):
            loaded_data.node_groups = [name for name in file_data.node_groups if name in names]
    except OSError:  # another process has removed it, or it is no .blend file
        return
    bpy.data.libraries.remove(bpy.data.libraries[file.name])
    for group in [group for group in groups if group.session_uid not in earlier_numbers]:
        # Reading a group brings the groups that it uses: copies of open groups are replaced by these.
        if (open_group := open_groups.get(group.get(KEY))) is not None:
            group.user_remap(open_group)
            groups.remove(group)


def restore_names() -> None:
    """Remove suffixes from the names of the project's groups in the open file, where no other group has the name."""
    groups = bpy.data.node_groups
    for group in [group for group in groups if KEY in group]:
        name = _SUFFIX.sub("", group.name)
        if name != group.name and name not in groups:
            group.name = name


def _kept_roads(file: Path | None) -> list[dict[str, str]]:
    """Return the groups of each kept road, names by key; none if the file was made by other source files."""
    if file is None:
        return []
    try:
        index = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
        return [dict(road) for road in index["roads"]] if index["made_by"] == _stamp() else []
    except (OSError, ValueError, KeyError, TypeError):
        return []


@cache
def _stamp() -> str:
    """Return a digest of the sizes and times of change of all source files of this package; cached."""
    blender = Path(__file__).parents[1]
    stats = [(str(path.relative_to(blender)), path.stat()) for path in sorted(blender.rglob("*.py"))]
    text = repr([(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats])
    return hashlib.sha256(text.encode()).hexdigest()[:16]
