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
        folder: folder of a trained run, or the name of a shipped model.
        cloud_file: file of the cloud on which the model is used.

    Raises:
        MissingFileError, InputError: it is no run of a centreline model, or its training isn't finished.
    """
    trained_run = open_run(folder)
    name = trained_run.configuration.task
    if name != "centerline":
        raise InputError("--run", str(folder), f"is a model for {name}; name a centreline model")

    def predict(cloud: RoadCloud, path: CloudPath) -> tuple[Float, Float]:
        """Return offset and standard deviation (M,), m, of the predicted axis along a path."""
        with scratch_folder() as folder_for_files:
            course, lines = folder_for_files / "path.csv", folder_for_files / "axis.geojson"
            points = path.points[::5] + cloud.origin[:2]
            np.savetxt(course, points, delimiter=",", header="x,y", comments="", fmt="%.4f")
            task(name).predict(trained_run, Prediction(cloud_file, lines, course))
            return axis_beside(read_json(lines), cloud.origin, path)

    return predict


def axis_beside(document: object, origin: Float, path: CloudPath) -> tuple[Float, Float]:
    """Return offset and standard deviation (M,), m, of GeoJSON centrelines at each point of a path; NaN where none is.

    Args:
        document: GeoJSON with features whose ``feature`` is ``centerline``, and ``std`` per vertex.
        origin: (3,) map coordinates of the path's local origin.
        path: path whose M points are looked at.
    """
    features = document.get("features", []) if isinstance(document, dict) else []
    offset, std = np.full(len(path.points), np.nan), np.full(len(path.points), np.nan)
    for feature in features:
        properties = feature.get("properties", {})
        points = np.array(feature.get("geometry", {}).get("coordinates", []), dtype=np.float64)
        if properties.get("feature") != "centerline" or len(points) < 2:
            continue
        station, offsets = path.project(points[:, :2] - origin[:2])
        order = np.argsort(station, kind="stable")
        stated_std = properties.get("std") or [_USUAL_STD] * len(points)
        deviation = np.array([_USUAL_STD if value is None else value for value in stated_std], dtype=np.float64)
        target = path.stations
        next_vertex = np.clip(np.searchsorted(station[order], target), 1, len(points) - 1)
        previous_station, next_station = station[order][next_vertex - 1], station[order][next_vertex]
        between_vertices = (
            (target >= previous_station - 1e-9)
            & (target <= next_station + 1e-9)
            & (next_station - previous_station <= _GAP)
        )
        offset = np.where(between_vertices, np.interp(target, station[order], offsets[order]), offset)
        std = np.where(between_vertices, np.interp(target, station[order], deviation[order]), std)
    return offset, std
