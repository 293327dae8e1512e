"""A calibration as a job of the window, and its result as an image."""

from __future__ import annotations

import bpy
import numpy as np

from ...calibration.job import Calibration, CalibrationJob, steps
from ...calibration.plot import calibration_picture
from .job import Aside, Report, Work

PICTURE = "SynthRoads Calibration"
"""Name of the image that shows the result."""


def calibration_work(job: CalibrationJob) -> Work[Calibration]:
    """Calibrate in a thread: it touches none of Blender's data."""

    def work(report: Report) -> Calibration:
        run = steps(job)
        while True:
            try:
                report(next(run))
            except StopIteration as end:
                result: Calibration = end.value
                return result

    result: Calibration = yield Aside(work, "Calibrating")
    return result


latest: Calibration | None = None
"""The last result."""


def fitted_result() -> Calibration | None:
    """Return the last result if it is a fit."""
    return latest if latest is not None and latest.job.fit and latest.job.real is not None else None


def show_picture(result: Calibration) -> bpy.types.Image:
    """Return the image that shows a result; made, or drawn anew where the file has it."""
    drawn = np.asarray(calibration_picture(result).convert("RGBA"), dtype=np.float32)[::-1] / 255.0
    height, width = drawn.shape[:2]
    image = bpy.data.images.get(PICTURE)
    if image is None:
        image = bpy.data.images.new(PICTURE, width, height)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(drawn).ravel())
    image.update()
    return image
