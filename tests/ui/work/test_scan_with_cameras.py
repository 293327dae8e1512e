"""The panel's scan beside the window takes the images of its cameras, as the library does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from synthroads_addon.jobs.images.reader import read_images
from synthroads_addon.ui.work import scan
from synthroads_addon.ui.work.job import PanelJob
from synthroads_addon.ui.work.scan import scan_work
from tests.helpers.scenes.panel_road import (  # noqa: F401
    cheap,
    road,
    road_file,
    settings,
    small_pictures,
    wait_for_end,
)

pytestmark = pytest.mark.usefixtures("small_pictures")


def test_images_are_taken_beside_the_window_as_by_the_button(road: Any, tmp_path: Path) -> None:  # noqa: F811
    road.scan.own_cameras = True
    cameras = road.scan.cameras
    cameras.rig, cameras.spacing, cameras.samples = "kitti-stereo", 60.0, 2
    cameras.own_megapixels, cameras.megapixels = True, 0.01
    job = PanelJob("Scan", scan_work(scan.requested_scan(bpy.context)))
    job.start()
    wait_for_end(job)
    assert job.error is None
    road.output = str(tmp_path / "again")
    assert bpy.ops.synthroads.scan() == {"FINISHED"}
    beside, alone = (read_images(tmp_path / name / "images") for name in ("out", "again"))
    assert len(beside) == len(alone) > 2
    for one, other in zip(beside, alone, strict=True):
        assert np.array_equal(one.position, other.position)
        for layer in ("rgb", "depth", "normal", "class", "instance"):
            assert np.array_equal(one.layer(layer), other.layer(layer)), layer
    assert any(image.layer("rgb").std() > 5.0 for image in beside)
