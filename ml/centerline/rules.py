"""Centrelines by the views that learn nothing, and by these with a network's, as predictors that are measured."""

from __future__ import annotations

import numpy as np

from synthroads_addon.base.arrays import Float, UInt8
from synthroads_addon.base.errors import InputError
from synthroads_addon.base.maps.places import Placement
from synthroads_addon.reconstruction.axis import FoundRoad, Options, find_axis, straighten_path
from synthroads_addon.reconstruction.axis import Predictor as AxisPredictor
from synthroads_addon.reconstruction.centreline import INTERVALS
from synthroads_addon.reconstruction.cloud import KIND_OF_CLASS, PointKind, RoadCloud
from synthroads_addon.reconstruction.path import CloudPath
from synthroads_addon.reconstruction.views.fusion import DEFINITION
from synthroads_addon.reconstruction.views.intervals import half_width
from synthroads_addon.road.axes.measured_axis import MeasuredAxis

from ..data.frames import Frames
from ..data.points import UNSORTED_CLASSES
from ..data.roads import LearningRoad
from ..scores.evaluation import CORRIDOR_COLUMNS, Predictor

_LABELLED_SHARE, _MARKED_SHARE = 0.01, 0.001
"""Shares of pavement and paint from which on labels are believed: as `reconstruction.cloud` does."""
_FEWEST = 2000
"""Points of a road at least: as `reconstruction.cloud.FEWEST_POINTS`."""


def road_cloud(road: LearningRoad) -> RoadCloud:
    """Return a road's ground points as the reconstruction reads them from a file; unsorted ones count as ground."""
    table = np.full(256, PointKind.OTHER, dtype=np.uint8)
    for number, name in road.class_names.items():
        is_unclassified = name in UNSORTED_CLASSES
        table[number] = PointKind.GROUND if is_unclassified else KIND_OF_CLASS.get(name, PointKind.OTHER)
    rows = np.asarray(road.belonging)
    kind: UInt8 = table[road.class_id[rows]]
    is_pavement = np.isin(kind, (PointKind.PAVEMENT, PointKind.MARKING))
    has_pavement_class = bool(is_pavement.sum() > _LABELLED_SHARE * len(kind))
    has_marking_class = has_pavement_class and bool(
        (kind == PointKind.MARKING).sum() > _MARKED_SHARE * is_pavement.sum()
    )
    intensity = np.asarray(road.intensity[rows], dtype=np.float32)
    xyz = np.asarray(road.xyz[rows], dtype=np.float64)
    return RoadCloud(
        xyz, intensity, kind, np.zeros(3), Placement(), has_pavement_class, has_marking_class, len(kind), {}
    )


def views_predictor(network: Predictor | None = None) -> Predictor:
    """Return a predictor of centres with deviations and intervals, m, by all rule-based views, and perhaps a network's.

    Where no road can be made out nothing is predicted.

    Args:
        network: predictor whose centres are one more view; None for rule-based views alone.
    """

    def predict(road: LearningRoad, frames: Frames) -> Float:
        """Return the values (M, columns) of `CORRIDOR_COLUMNS` in the frames; all NaN without a road."""
        view = None if network is None else _network_view(network, road, frames)
        options = Options(path=frames.position, predictor=view)
        try:
            cloud = road_cloud(road)
            if len(cloud.xyz) < _FEWEST:
                raise InputError("road", len(cloud.xyz), f"at least {_FEWEST} points are needed")
            path, profile_reach = straighten_path(cloud, options)
            road_axis = find_axis(cloud, path, profile_reach, options)
        except InputError:
            return np.full((len(frames), len(CORRIDOR_COLUMNS)), np.nan)
        return _in_frames(road_axis, frames)

    return predict


def _network_view(network: Predictor, road: LearningRoad, frames: Frames) -> AxisPredictor:
    """Return a network's centres on a road as a view for the reconstruction: a function of cloud and path."""
    centres = network(road, frames)

    def predict(cloud: RoadCloud, path: CloudPath) -> tuple[Float, Float]:
        """Return offset and standard deviation (M,), m, of the network's centreline along a path; NaN beyond it."""
        is_predicted = np.isfinite(centres[:, 0])
        offset, std = np.full(len(path.points), np.nan), np.full(len(path.points), np.nan)
        if is_predicted.sum() < 2:
            return offset, std
        station, offsets = path.project(frames.at(centres[:, 0])[is_predicted])
        order = np.argsort(station, kind="stable")
        in_range = (path.stations >= station.min()) & (path.stations <= station.max())
        offset = np.where(in_range, np.interp(path.stations, station[order], offsets[order]), np.nan)
        std = np.where(in_range, np.interp(path.stations, station[order], centres[is_predicted, 1][order]), np.nan)
        return offset, std

    return predict


def _in_frames(road: FoundRoad, frames: Frames) -> Float:
    """Return y (m) at which a found axis crosses each of M frames, with its deviation and intervals.

    The columns are `CORRIDOR_COLUMNS`; unknown ones are NaN.
    """
    axis = road.axis
    stations = road.path.stations
    points = road.path.place(stations, np.interp(stations, axis.stations, axis.offsets))
    y, _ = MeasuredAxis(points).crossing(frames.position, frames.direction)
    station, _ = road.path.project(frames.position)
    interval_widths = [half_width(axis, share, factor, DEFINITION) for share, factor in INTERVALS.values()]
    spread = [np.hypot(DEFINITION, axis.std), *interval_widths]
    columns = [np.where(np.isfinite(y), np.interp(station, axis.stations, values), np.nan) for values in spread]
    named_columns = dict(zip(("center_std", "center_68", "center_95"), columns, strict=True)) | {"center": y}
    return np.column_stack([named_columns.get(name, np.full(len(y), np.nan)) for name in CORRIDOR_COLUMNS])
