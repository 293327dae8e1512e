"""Classes that a model has given a cloud's points: how many there are, and how they agree with the cloud's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base.arrays import UInt8
from ...base.classes import UNLABELLED, ClassScheme, class_scheme, scheme_names
from ..formats.header import CloudHeader
from ..layers import PREDICTED
from ..points import PointBlock


class PredictedCounts:
    """Points of a cloud by its own class and the predicted one, counted block by block.

    Args:
        header: of a cloud with predicted classes.
    """

    def __init__(self, header: CloudHeader) -> None:
        assert header.predicted is not None
        self._predicted: ClassScheme = header.predicted
        self._truth = truth_table(header)
        self._counts = np.zeros((256, 256), dtype=np.int64)

    def add(self, block: PointBlock) -> None:
        """Count a block's points."""
        place = block.class_id.astype(np.intp) * 256 + block.array(PREDICTED)
        self._counts += np.bincount(place, minlength=256**2).reshape(256, 256)

    def figures(self) -> dict[str, Any]:
        """Return points and share of each predicted class, and the agreement with the cloud's own, as JSON data.

        The agreement is None where the cloud's classes are none that the predicted ones can be compared with; points
        without a class of their own, or without a predicted one, don't count in it.
        """
        names, total = self._predicted.names(), max(1, int(self._counts.sum()))
        sums = self._counts.sum(axis=0)
        present = np.flatnonzero(sums).tolist()
        shares = {names.get(i, f"class_{i}"): {"points": int(sums[i]), "share": sums[i] / total} for i in present}
        return {"predicted_classes": shares, "agreement": self._agreement()}

    def _agreement(self) -> dict[str, Any] | None:
        """Return the number of points with both classes, the share whose classes agree, and the IoU of each class."""
        if self._truth is None:
            return None
        # (truth, predicted) in the classes of the prediction.
        matrix = np.zeros((256, 256), dtype=np.int64)
        np.add.at(matrix, self._truth, self._counts)
        matrix[UNLABELLED] = matrix[:, UNLABELLED] = 0
        agreeing, truth, predicted = matrix.diagonal(), matrix.sum(axis=1), matrix.sum(axis=0)
        union = truth + predicted - agreeing  # intersection over union: agreeing / union
        ious = {row.name: agreeing[row.id] / union[row.id] for row in self._predicted.rows if union[row.id]}
        points = int(truth.sum())
        return {"points": points, "share": agreeing.sum() / points if points else None, "iou": ious}


def truth_table(header: CloudHeader) -> UInt8 | None:
    """Return a (256,) table from a cloud's own classes to those of its predicted ones; None if they don't compare.

    They compare where the cloud has the full table's classes or those of the same scheme; classes that the predicted
    ones lack become `UNLABELLED`.
    """
    predicted = header.predicted
    if predicted is None or not header.labelled:
        return None
    if header.scheme.name == "17" and predicted.name in scheme_names():
        table: UInt8 = class_scheme(predicted.name).ids
        return table
    ids = {row.name: row.id for row in predicted.rows}
    ids_by_row = {row.id: ids[row.name] for row in header.scheme.rows if row.name in ids}
    if not ids_by_row:
        return None
    table = np.full(256, UNLABELLED, dtype=np.uint8)
    table[list(ids_by_row)] = list(ids_by_row.values())
    return table
