"""The axis as a trained centreline model tells it, by way of `synthroads predict`."""

from pathlib import Path as FilePath

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.schema import read_json
from synthroads_addon.base.scratch.folders import scratch_folder
from synthroads_addon.reconstruction.axis import Predictor
from synthroads_addon.reconstruction.cloud import RoadCloud
from synthroads_addon.reconstruction.path import CloudPath

from ..shipped import open_run
from ..tasks import Prediction, task

_USUAL_STD = 0.1
"""Deviation where the model tells none, m. Chosen: about what trained models leave."""
_GAP = 5.0
"""Distance between points of a line across which nothing is told, m. Chosen: a stretch of the profiles."""


def learned_axis(folder: FilePath, cloud_file: FilePath) -> Predictor:
    """Return a function (cloud, path) -> (offset, std) of the axis along the path, m, by a trained centreline model.

    Args:
        folder: of the run, or the name of a shipped model.
        cloud_file: the cloud that the axis is wanted of.

    Raises:
        MissingFileError, InputError: it is no run of a centreline model, or its training isn't finished.
    """
    trained = open_run(folder)
    name = trained.configuration.task
    if name != "centerline":
        raise InputError("--run", str(folder), f"is a model for {name}; name a centreline model")

    def predict(cloud: RoadCloud, path: CloudPath) -> tuple[Float, Float]:
        with scratch_folder() as place:
            course, lines = place / "path.csv", place / "axis.geojson"
            points = path.points[::5] + cloud.origin[:2]
            np.savetxt(course, points, delimiter=",", header="x,y", comments="", fmt="%.4f")
            task(name).predict(trained, Prediction(cloud_file, lines, course))
            return axis_beside(read_json(lines), cloud.origin, path)

    return predict


def axis_beside(document: object, origin: Float, path: CloudPath) -> tuple[Float, Float]:
    """Return offset and standard deviation (M,), m, of GeoJSON centrelines at each point of a path; NaN beside none.

    Args:
        document: GeoJSON with features whose ``feature`` is ``centerline``, and ``std`` per vertex.
        origin: (3,) map coordinates of the path's local origin.
        path: beside which.
    """
    features = document.get("features", []) if isinstance(document, dict) else []
    offset, std = np.full(len(path.points), np.nan), np.full(len(path.points), np.nan)
    for feature in features:
        told = feature.get("properties", {})
        points = np.array(feature.get("geometry", {}).get("coordinates", []), dtype=np.float64)
        if told.get("feature") != "centerline" or len(points) < 2:
            continue
        station, beside = path.project(points[:, :2] - origin[:2])
        order = np.argsort(station, kind="stable")
        given = told.get("std") or [_USUAL_STD] * len(points)
        deviation = np.array([_USUAL_STD if value is None else value for value in given], dtype=np.float64)
        target = path.stations
        after = np.clip(np.searchsorted(station[order], target), 1, len(points) - 1)
        low, high = station[order][after - 1], station[order][after]
        near = (target >= low - 1e-9) & (target <= high + 1e-9) & (high - low <= _GAP)
        offset = np.where(near, np.interp(target, station[order], beside[order]), offset)
        std = np.where(near, np.interp(target, station[order], deviation[order]), std)
    return offset, std
