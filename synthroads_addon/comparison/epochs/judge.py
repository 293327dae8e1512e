"""Scores of a detector of changes: points by kind, objects found, missed and false, errors of distances by size."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...base.arrays import AnyArray, Bool, Float
from ...road.changes.change import KINDS, Change, ChangeList
from ...scanning.epochs.truth import CODES, UNCHANGED
from .pairs import Detected, EpochPoints

FOUND_SHARE = 0.5
"""Share of a change's points that must be found for it to count as found; chosen."""
_FEWEST = 3
"""Points that a change must have in the cloud for it to be judged; chosen."""
_CLUSTER, _FEWEST_FALSE = 1.0, 10
"""Edge (m) of the cells by which false points are joined to false objects, and points that one has at least; chosen."""
CELL = 0.5
"""Edge of the cells of surface whose share found is given by the size of the change, m."""
STEPS = (0.0005, 0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 1.0)
"""Borders of the sizes by which the share found is given, m."""
_NEAR = 5.0
"""Distance along the road, m, within which a listed change is one of a truth's; chosen."""


def judge_points(points: EpochPoints, result: Detected, limit: float) -> dict[str, Any]:
    """Return the scores of a detector's distances or labels of the second epoch's points as JSON data.

    Args:
        points: with the truth.
        result: of the detector.
        limit: distance beyond which a point counts as changed where the result has no limits or labels, m.
    """
    judged = points.judged
    changed = result.changed(limit)
    assert changed is not None
    truth = points.change != UNCHANGED
    report: dict[str, Any] = {
        "points": len(truth),
        "judged": int(judged.sum()),
        "changed": _overlap(truth[judged], changed[judged]),
        "objects": _objects(points, changed, judged),
    }
    if result.knows_kinds and result.label is not None:
        report["kinds"] = _by_kind(points.change[judged], result.label[judged])
        ious = [row["iou"] for row in report["kinds"].values()]
        report["mean_iou_of_changes"] = round(float(np.mean(ious)), 4) if ious else None
    if result.distance is not None:
        report["distances"] = _distances(points, result.distance, judged)
    report["found_by_size"] = _found_by_size(points, changed, judged)
    return report


def _overlap(truth: Bool, found: Bool) -> dict[str, float | int | None]:
    """Return intersection over union, precision and recall of changed points, and the share of false alarms."""
    both, union = int((truth & found).sum()), int((truth | found).sum())
    unchanged = int((~truth).sum())
    return {
        "iou": _ratio(both, union),
        "precision": _ratio(both, int(found.sum())),
        "recall": _ratio(both, int(truth.sum())),
        "false_alarms": _ratio(int((found & ~truth).sum()), unchanged),
    }


def _ratio(part: float, whole: float) -> float | None:
    """Return a share, rounded; None of nothing."""
    return round(part / whole, 6) if whole else None


def _by_kind(truth: AnyArray, label: AnyArray) -> dict[str, dict[str, Any]]:
    """Return IoU, precision and recall of each kind that the truth or the labels have."""
    rows: dict[str, dict[str, Any]] = {}
    for kind in KINDS:
        is_kind, is_label = truth == CODES[kind], label == CODES[kind]
        if is_kind.any() or is_label.any():
            both = int((is_kind & is_label).sum())
            rows[kind] = {
                "points": int(is_kind.sum()),
                "iou": _ratio(both, int((is_kind | is_label).sum())),
                "precision": _ratio(both, int(is_label.sum())),
                "recall": _ratio(both, int(is_kind.sum())),
            }
    return rows


def _objects(points: EpochPoints, changed: Bool, judged: Bool) -> dict[str, Any]:
    """Return how many changes were found and missed, in all and by kind, and how many false objects there are."""
    numbers = points.change_id[judged]
    count, hits = np.bincount(numbers), np.bincount(numbers, weights=changed[judged])
    kinds = dict(zip(numbers.tolist(), points.change[judged].tolist(), strict=True))
    found: Counter[str] = Counter()
    missed: Counter[str] = Counter()
    names = {code: kind for kind, code in CODES.items()}
    for number in np.flatnonzero(count >= _FEWEST).tolist():
        if number:
            into = found if hits[number] >= FOUND_SHARE * count[number] else missed
            into[names[kinds[number]]] += 1
    false_places = points.xyz[judged & changed & (points.change == UNCHANGED)]
    by_kind = {kind: {"found": found[kind], "missed": missed[kind]} for kind in KINDS if found[kind] or missed[kind]}
    return {
        "found": sum(found.values()),
        "missed": sum(missed.values()),
        "false": _clusters(false_places),
        "by_kind": by_kind,
    }


def _clusters(places: Float) -> int:
    """Return how many objects falsely changed points (N, 3) are: cells with them that touch each other are one."""
    if not len(places):
        return 0
    cells, inverse = np.unique(np.floor(places / _CLUSTER).astype(np.int64), axis=0, return_inverse=True)
    counts = np.bincount(inverse.ravel(), minlength=len(cells))
    pairs = cKDTree(cells).query_pairs(1.8, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    _, label = connected_components(links, directed=False)
    return int((np.bincount(label, weights=counts) >= _FEWEST_FALSE).sum())


def _distances(points: EpochPoints, distance: Float, judged: Bool) -> dict[str, Any]:
    """Return the errors of distances, mm: of unchanged points, and of those of each kind that has distances."""
    rows = {}
    valid = judged & np.isfinite(distance)
    for kind, code in CODES.items():
        chosen = valid & (points.change == code)
        if chosen.any() and kind != "mobile":
            error = 1000.0 * (distance[chosen] - points.distance[chosen])
            rows[kind] = {
                "points": int(chosen.sum()),
                "bias_mm": round(float(error.mean()), 4),
                "spread_mm": round(float(error.std()), 4),
                "median_mm": round(float(np.median(error)), 4),
                "rms_mm": round(float(np.sqrt((error**2).mean())), 4),
            }
    return {"without": int((judged & ~np.isfinite(distance)).sum()), "by_kind": rows}


def _found_by_size(points: EpochPoints, changed: Bool, judged: Bool) -> list[dict[str, Any]]:
    """Return the share of surface cells found by the size of their change: the mean true distance of their points.

    A cell is found where at least half of its points are. The first row, up to the first border, are false alarms.
    """
    chosen = judged & (np.abs(points.distance) < STEPS[-1])
    if not chosen.any():
        return []
    cells, inverse = np.unique(np.floor(points.xyz[chosen] / CELL).astype(np.int64), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    count = np.bincount(inverse, minlength=len(cells))
    size = np.abs(np.bincount(inverse, points.distance[chosen], len(cells)) / count)
    is_found = np.bincount(inverse, changed[chosen], len(cells)) >= FOUND_SHARE * count
    rows = []
    for low, high in zip((0.0, *STEPS[:-1]), STEPS, strict=True):
        within = (size >= low) & (size < high) & (count >= _FEWEST)
        if within.any():
            found = round(float(is_found[within].mean()), 4)
            rows.append({"from_m": low, "to_m": high, "cells": int(within.sum()), "found": found})
    return rows


def judge_list(truth: ChangeList, result: ChangeList) -> dict[str, Any]:
    """Return the scores of a list of changes beside the true one as JSON data: found, missed, false, errors of size.

    A listed change is a true one of the same kind whose things it names, or whose extent is within `_NEAR` along the
    road; each is used once, the nearest first.
    """
    pairs = sorted(
        (gap, i, j)
        for i, change in enumerate(truth.changes)
        for j, other in enumerate(result.changes)
        if (gap := _gap(change, other)) is not None
    )
    used: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in used and j not in used.values():
            used[i] = j
    by_kind: dict[str, dict[str, Any]] = {}
    for kind in KINDS:
        rows = [i for i, change in enumerate(truth.changes) if change.kind == kind]
        others = [j for j, change in enumerate(result.changes) if change.kind == kind]
        errors = [abs(truth.changes[i].size - result.changes[used[i]].size) for i in rows if i in used]
        if rows or others:
            by_kind[kind] = {
                "found": len(errors),
                "missed": len(rows) - len(errors),
                "false": len(others) - len(errors),
                "mean_error_of_size": round(float(np.mean(errors)), 6) if errors else None,
            }
    totals = {name: sum(row[name] for row in by_kind.values()) for name in ("found", "missed", "false")}
    return {"objects": {**totals, "by_kind": by_kind}}


def _gap(change: Change, other: Change) -> float | None:
    """Return the distance along the road between two changes of a kind, m, 0 of the same things; None of others."""
    if change.kind != other.kind or change.detail != other.detail:
        return None
    if change.things and set(change.things) == set(other.things) and change.edits[0].path == other.edits[0].path:
        return 0.0
    a, b = change.extent, other.extent
    gap = max(a.start_station - b.end_station, b.start_station - a.end_station, 0.0)
    middle = abs(a.start_station + a.end_station - b.start_station - b.end_station) / 2.0
    return gap + 1e-3 * middle if gap <= _NEAR and not (change.things and other.things and gap > 0.0) else None
