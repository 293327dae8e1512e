"""Node groups of the road model that are made once for all tests: making them takes most of a short road's time."""

from __future__ import annotations

import os
import sys
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import bpy

from synthroads_addon.blender import nodes, things
from synthroads_addon.blender.nodes import builder


class KeptGroups:
    """Keeps each node group that the road model makes in a file, and takes it from there when it is asked for again.

    Nothing comes into the open file before it is asked for: a test finds what it would find if the group were made.

    Processes that test side by side share the folder: what one has made the others take.

    Attributes:
        on: whether it does so; if not, groups are made as ever.
    """

    def __init__(self, folder: Path) -> None:
        self.on = True
        self._folder = folder
        self._make = builder.node_group
        for package in (nodes, things):
            for module in walk_packages(package.__path__, f"{package.__name__}."):
                import_module(module.name)
        for name, module in list(sys.modules.items()):
            if name.startswith("synthroads_addon.") and vars(module).get("node_group") is self._make:
                module.node_group = self._node_group  # type: ignore[attr-defined]

    def _node_group(
        self, name: str, build: Any, *arguments: object, description: str = "", kind: str = "GeometryNodeTree"
    ) -> bpy.types.NodeTree:
        wanted = repr((builder._sources_digest(), name, arguments))
        about = self._folder / f"{sha256(wanted.encode()).hexdigest()}.txt"
        key = about.read_text() if self.on and about.exists() else None
        if key is not None and all(group.get(builder.KEY) != key for group in bpy.data.node_groups):
            return self._take(key, name)
        group = self._make(name, build, *arguments, description=description, kind=kind)
        if self.on and key is None:
            self._keep(group, about)
        return group

    def _keep(self, group: bpy.types.NodeTree, about: Path) -> None:
        """Write a group to its file, and then that it is there: another process may make the same meanwhile."""
        part = self._folder / f"part-{os.getpid()}"
        bpy.data.libraries.write(str(part), {group}, fake_user=True)
        part.replace(self._file(group[builder.KEY]))
        part.write_text(group[builder.KEY])
        part.replace(about)

    def _file(self, key: str) -> Path:
        return self._folder / f"{key}.blend"

    def _take(self, key: str, name: str) -> bpy.types.NodeTree:
        """Put a group that was kept into the open file, with those in it that the file hasn't."""
        if old := bpy.data.node_groups.get(name):
            old.name = f"{name} (older)"
        groups = bpy.data.node_groups
        before = {group.session_uid for group in groups}
        there = {group[builder.KEY]: group for group in groups if builder.KEY in group}
        with bpy.data.libraries.load(str(self._file(key)), link=False) as (_, mine):
            mine.node_groups = [name]
        bpy.data.libraries.remove(bpy.data.libraries[self._file(key).name])
        for group in [group for group in groups if group.session_uid not in before]:
            if (same := there.get(group.get(builder.KEY))) is not None:
                group.user_remap(same)
                groups.remove(group)
        group = groups[name]
        group.use_fake_user = False
        return group
