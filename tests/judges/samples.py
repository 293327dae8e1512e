"""The files that judges are given: one small road, its twins and a cloud in each format, written when asked for."""

from __future__ import annotations

import shutil
from functools import cached_property
from pathlib import Path

from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from synthroads_addon.cloud.sweeps.registry import ENTRIES as SWEEP_ENTRIES
from synthroads_addon.cloud.sweeps.registry import open_sweep_writer
from synthroads_addon.road.geometry import RoadGeometry
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.twin.formats import FORMATS, write_twin
from synthroads_addon.twin.scene.registry import ENTRIES as SCENE_ENTRIES
from synthroads_addon.twin.scene.registry import write_scene

_SWEEPS = {entry.file: name for name, entry in SWEEP_ENTRIES.items()}
_SCENES = {entry.file: name for name, entry in SCENE_ENTRIES.items() if entry.writer}
_TWINS = {entry.file: name for name, entry in FORMATS.items()}
INTENSITY_SCALE = 65535 * 900.0


class Samples:
    """One road's files in a folder.

    Attributes:
        folder: where they are; it must be there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def road(self) -> RoadParameters:
        """600 m with an arc, a clothoid and a line, grades and a rounding, an entry, barriers and signs, in UTM."""
        from tests.helpers.roads.twin_roads import road

        return road(7, length=600.0)

    @cached_property
    def geometry(self) -> RoadGeometry:
        """The road's analytic geometry."""
        return RoadGeometry(self.road)

    @cached_property
    def points(self) -> PointBlock:
        """Content of the clouds."""
        from tests.helpers.clouds.random_points import make_points

        return make_points(5_000)

    def file(self, name: str) -> Path:
        """Return the path of a file, written unless it is there: parameters, twins, clouds, sweeps, scenes."""
        path = self.folder / name
        if path.exists():
            return path
        if (first := name.partition("/")[0]) in _SWEEPS:
            from tests.helpers.clouds import sweeps

            writer = open_sweep_writer(_SWEEPS[first], self.folder, sweeps.place())
            for sweep in sweeps.sweeps():
                writer.write(sweep)
            writer.close()
            return path
        if first in _SCENES:
            from tests.helpers.scenes.labelled import labelled_scene

            write_scene(labelled_scene(), _SCENES[first], self.folder)
            return path
        if name == "parameters.json":
            path.write_text(self.road.to_json(), encoding="utf-8")
        elif name in _TWINS:
            write_twin(self.road, self.folder, [_TWINS[name]])
        else:
            with open_writer(path, self.road.metadata.epsg, self.points.xyz.min(axis=0), INTENSITY_SCALE) as writer:
                writer.write(self.points)
        return path

    def text(self, name: str) -> str:
        """Return what a file of text says."""
        return self.file(name).read_text(encoding="utf-8")

    def with_text(self, name: str, old: str, new: str) -> Samples:
        """Return files of which one has another text in the first place where a text stands."""
        data = self.text(name)
        assert old in data, (name, old)
        return self.with_file(name, data.replace(old, new, 1).encode())

    def with_file(self, name: str, data: bytes) -> Samples:
        """Return files of which one holds something else."""
        self.file(name)
        folder = self.folder / "spoiled"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.folder, folder)
        (folder / name).write_bytes(data)
        other = Samples(folder)
        other.__dict__.update({key: value for key, value in self.__dict__.items() if key != "folder"})
        return other
