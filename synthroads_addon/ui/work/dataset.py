"""Data sets made from the window: the command's own work in a thread, and small pictures of the scenes done."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import bpy
from PIL import Image

from ...base.errors import InputError
from ...base.process.modules import launch_modules_by
from ...cloud.tools.convert import draw_previews
from ...dataset.manifest import Manifest, SceneEntry, read_manifest
from ...dataset.recipe import Recipe, scene_jobs
from ...jobs.dataset.processes import local_processes
from ...jobs.dataset.run import DatasetRun
from .job import Report

_SIDE = 256
"""Largest side of a scene's small picture, pixels; chosen."""
MOST_PICTURES = 8
"""Most pictures in the strip: the scenes that were done last. Chosen: two rows of four."""
_POINT_FILES = ("*.laz", "*.las", "*.ply", "*.pcd", "*.npz", "*.e57")
"""Patterns of a scene's cloud, the quickest to read first."""


@dataclass
class DatasetWork:
    """A data set to be made beside the window.

    Args:
        recipe: what is made.
        folder: where it goes.
        resume: continue what was begun there.
        overwrite: replace the data set that is there.
        jobs: scenes made at once.

    Attributes:
        pictures: small pictures (PNG) of scenes that are done, by name, the latest last.
        done, failed, total: numbers of scenes.
    """

    recipe: Recipe
    folder: Path
    resume: bool = False
    overwrite: bool = False
    jobs: int = 1
    pictures: dict[str, Path] = field(init=False, default_factory=dict)
    done: int = field(init=False, default=0)
    failed: int = field(init=False, default=0)
    total: int = field(init=False)
    _share: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self.total = len(scene_jobs(self.recipe))

    def make(self, report: Report) -> Manifest:
        """Make the data set in this thread, and return its manifest.

        Raises:
            InputError, OutputError: see `DatasetRun.run`.
            Cancelled: by `report`; scenes that are done stay.
        """

        def progress(stage: str, share: float) -> None:
            self._share = share
            report(share)
            self._look()  # it takes a while to draw a picture

        run = DatasetRun(self.recipe, self.folder.absolute(), self.resume, progress, overwrite=self.overwrite)
        manifest = run.run(local_processes(self.jobs, beat=lambda: report(self._share)))
        self._count(manifest)
        return manifest

    def _look(self) -> None:
        """Count the scenes, and draw those that are new among the latest."""
        try:
            manifest = read_manifest(self.folder)
        except InputError:  # there is none yet
            return
        self._count(manifest)
        for scene in [scene for scene in manifest.scenes if scene.status == "done"][-MOST_PICTURES:]:
            if scene.name not in self.pictures and (picture := draw_scene(self.folder, scene)) is not None:
                self.pictures[scene.name] = picture

    def _count(self, manifest: Manifest) -> None:
        """Count the scenes of a manifest."""
        states = [scene.status for scene in manifest.scenes]
        self.done, self.failed = states.count("done"), states.count("failed")


def draw_scene(folder: Path, scene: SceneEntry) -> Path | None:
    """Draw a scene's cloud from above, small, by class; return the picture's file, None if it has no cloud to draw."""
    place = folder / "scenes" / scene.name
    cloud = next((path for pattern in _POINT_FILES for path in sorted(place.glob(pattern))), None)
    if cloud is None or not scene.points:
        return None
    work = Path(tempfile.mkdtemp(prefix="dataset-", dir=bpy.app.tempdir or None))
    draw_previews(cloud, work, picture="class")
    picture = next(work.glob("*.png"))
    with Image.open(picture, formats=("PNG",)) as large:
        small = large.convert("RGB")
    small.thumbnail((_SIDE, _SIDE))
    small.save(picture)
    return picture


def use_this_blender() -> None:
    """Have the processes of scenes run in this Blender's program, where Python itself has no bpy."""
    launch_modules_by(_command if bpy.app.binary_path else None)


def _command(module: str) -> list[str]:
    """Return the beginning of a command that runs a module in a Blender without a window; arguments follow it."""
    places = [os.path.abspath(place) for place in sys.path]  # noqa: PTH100 - "" is the working directory
    lines = f"import sys; sys.path += [p for p in {json.dumps(places)} if p not in sys.path]; "
    lines += f"sys.argv = [{module!r}, *sys.argv[sys.argv.index('--') + 1:]]; "
    lines += f"import runpy; runpy.run_module({module!r}, run_name='__main__')"
    return [bpy.app.binary_path, "--background", "--python-exit-code", "1", "--python-expr", lines, "--"]
