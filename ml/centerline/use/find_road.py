"""A trained model used on a cloud of which nothing is known, strip by strip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from synthroads_addon.base.progress import Progress, silent

from ..data.frames import along, read_path
from ..data.strips import find_ground, path_through, strips
from ..networks.models import TARGETS
from .predictor import CenterlinePredictor
from .writing import Found

_HEIGHT = TARGETS.index("height")


def find_road(
    predictor: CenterlinePredictor, cloud: Path, path: Path | None = None, progress: Progress = silent
) -> Found:
    """Find centreline and corridor along a cloud's road, in bounded memory however long it is.

    Args:
        predictor: a trained model.
        cloud: file with the road's points.
        path: line along the road, or the scanner's trajectory (CSV or GeoJSON, map coordinates); None: it is found in
            the cloud, as the middle of its ground.
        progress: told the share that is done.

    Raises:
        MissingFileError, InputError: a file is missing or damaged, or the cloud holds no ground.
    """
    line = None if path is None else read_path(path)
    ground = find_ground(cloud, progress)
    line = line or path_through(ground)
    frames = along(line, predictor.settings.frame_spacing)
    shape = (len(frames), len(TARGETS))
    value, std, widths = np.full(shape, np.nan), np.full(shape, np.nan), np.full((*shape, 2), np.nan)
    for road, local, own in strips(cloud, ground, line, frames, progress):
        found = predictor.regress(road, local)
        # Frames keep their stations, which rise strictly, from strip to strip.
        number = np.searchsorted(frames.station, found.frames.station[own])
        value[number] = found.value[own]
        value[number, _HEIGHT] += road.origin[2]
        std[number], widths[number] = found.std[own], predictor.widths(found)[own]
        progress("finding the road", float(number[-1] + 1) / len(frames) if len(number) else 0.0)
    kept = _span(value[:, 0])
    return Found(frames.select(kept), value[kept], std[kept], widths[kept], ground.header.epsg)


def _span(center: NDArray[np.float64]) -> slice:
    """Return the frames from the first to the last in which something was found; all if nothing was."""
    there = np.flatnonzero(np.isfinite(center))
    return slice(int(there[0]), int(there[-1]) + 1) if len(there) else slice(None)
