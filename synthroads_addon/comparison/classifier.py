"""How surely synthetic patches can be told from real ones: a two-sample test by a classifier.

A classifier is trained on some of both and asked about the others; the area under its ROC curve (AUC) is 0.5 where it
can't tell them apart and 1 where it never errs (Lopez-Paz and Oquab, "Revisiting classifier two-sample tests", 2017).
Beside it the maximum mean discrepancy of the same statistics (Gretton et al., "A kernel two-sample test", 2012), and
the AUC of each statistic alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import rankdata

from ..base.arrays import Bool, Float, Index
from ..base.errors import InputError
from ..cloud.selection.patches import FEATURES, GROUPS, Patches, match_density
from .chamfer import mean_chamfer

FOLDS = 5
"""Folds of the cross-validation. Chosen: as usual (Hastie, Tibshirani and Friedman, 7.10: five or ten)."""
BLOCK = 20.0
"""Patches of a square of this edge, m, are learned or asked for together: neighbours are alike. Chosen: beyond the
wavelength of most variation."""
MOST = 1500
"""Patches of each side that are used, at most. Chosen: bounds the work; more patches hardly move the accuracy."""
FEWEST = 60
"""Patches of each side that a comparison needs. Chosen: twelve in each fold."""
_MOST_OF_KERNEL = 600
"""Patches that the kernel two-sample test takes at most. Chosen: its work grows with their square."""
_TREES = 100
"""Trees that are boosted, one after another: as many as scikit-learn takes by default."""


@dataclass(frozen=True)
class Distinction:
    """Measures of how well two sets of patches are told apart: AUC of classifiers and features, and MMD.

    Attributes:
        patches: number of patches of each side.
        auc: AUC of a classifier by group of statistics (`GROUPS`), and by all; empty without `has_classifier`.
        features: AUC of each statistic alone, 0.5 to 1.
        mmd: squared maximum mean discrepancy of all statistics.
        chamfer: mean density-aware Chamfer distance of the patches' points, 0 to 1.
    """

    patches: int
    auc: dict[str, float]
    features: dict[str, float]
    mmd: float
    chamfer: float

    def to_dict(self) -> dict[str, Any]:
        """Return patch count, AUC and squared maximum mean discrepancy as JSON data."""
        rounded_measures = {
            name: {key: round(value, 4) for key, value in getattr(self, name).items()} for name in ("auc", "features")
        }
        return {
            "patches": self.patches,
            **rounded_measures,
            "mmd": round(self.mmd, 6),
            "chamfer": round(self.chamfer, 5),
        }


def has_classifier() -> bool:
    """Return whether scikit-learn is installed, whose trees tell clouds apart; statistics alone need only SciPy."""
    return find_spec("sklearn") is not None


def distinguish(patches: Patches, other_patches: Patches, seed: int, name: str) -> Distinction:
    """Return how well a classifier tells two sets of patches apart: AUC and discrepancy at equal densities.

    Args:
        one, other: the sets.
        seed: seed by which patches and folds are drawn.
        name: name of the first set, for errors.

    Raises:
        InputError: fewer than `FEWEST` patches of each have the same densities.
    """
    first_sample, second_sample = _samples(patches, other_patches, seed, name)
    values = np.concatenate([first_sample.values, second_sample.values])
    truth = np.arange(len(values)) < len(first_sample)
    auc = _auc_of_groups(first_sample, second_sample, seed)
    features = {name: _auc_alone(values[:, number], truth) for number, name in enumerate(FEATURES)}
    discrepancy = squared_discrepancy(values[truth], values[~truth])
    return Distinction(len(first_sample), auc, features, discrepancy, mean_chamfer(first_sample, second_sample))


def classifier_auc(patches: Patches, other_patches: Patches, seed: int, name: str) -> dict[str, float]:
    """Return the AUC by group of statistics alone, in less time than `distinguish`; arguments and errors as there."""
    return _auc_of_groups(*_samples(patches, other_patches, seed, name), seed)


def _samples(patches: Patches, other_patches: Patches, seed: int, name: str) -> tuple[Patches, Patches]:
    """Return equally many patches of both sets with equal densities; arguments and errors as `distinguish`."""
    first_sample, second_sample = match_density(patches, other_patches, seed, MOST)
    if len(first_sample) < FEWEST:
        lower_density, upper_density = np.quantile(other_patches.density, (0.05, 0.95))
        raise InputError(
            name,
            len(first_sample),
            f"at least {FEWEST} patches must have a density like the compared clouds, "
            f"{lower_density:.0f} to {upper_density:.0f} points/m2",
        )
    return first_sample, second_sample


def _auc_of_groups(first_sample: Patches, second_sample: Patches, seed: int) -> dict[str, float]:
    """Return the AUC of a classifier for all statistics and for each group; empty without `has_classifier`."""
    values = np.concatenate([first_sample.values, second_sample.values])
    truth = np.arange(len(values)) < len(first_sample)
    blocks = np.concatenate([_blocks(first_sample, 0), _blocks(second_sample, 1)])
    columns = {group: [FEATURES.index(feature) for feature in names] for group, names in GROUPS.items()}
    columns = {"all": list(range(len(FEATURES))), **columns} if has_classifier() else {}
    return {group: _auc(values[:, column_numbers], truth, blocks, seed) for group, column_numbers in columns.items()}


def _blocks(patches: Patches, side: int) -> Index:
    """Return the id (P,) of the square of edge `BLOCK` that each patch lies in; the two sides share no id."""
    square = np.floor(patches.place / BLOCK).astype(np.int64)
    return np.asarray(np.unique(square, axis=0, return_inverse=True)[1].ravel() * 2 + side)


def _auc(values: Float, truth: Bool, blocks: Index, seed: int) -> float:
    """Return the cross-validated mean AUC of gradient-boosted trees, with whole blocks held out.

    The mean over the folds, not the AUC of all answers: a fold trained on fewer patches of one kind answers lower.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier  # an extra brings it
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import StratifiedGroupKFold

    folds = min(FOLDS, *(len(np.unique(blocks[truth == side])) for side in (True, False)))
    splitter = StratifiedGroupKFold(max(folds, 2), shuffle=True, random_state=seed)
    fold_aucs = []
    for training_rows, test_rows in splitter.split(values, truth, blocks):
        trees = HistGradientBoostingClassifier(max_iter=_TREES, random_state=seed)
        probabilities = trees.fit(values[training_rows], truth[training_rows]).predict_proba(values[test_rows])[:, 1]
        fold_aucs.append(roc_auc_score(truth[test_rows], probabilities))
    return float(np.nanmean(fold_aucs))


def _auc_alone(values: Float, truth: Bool) -> float:
    """Return the AUC of a single statistic, 0.5 to 1, whichever way it points (Mann and Whitney's U)."""
    n1, n2 = np.count_nonzero(truth), np.count_nonzero(~truth)
    # U = R1 - n1 (n1 + 1) / 2 with the sum R1 of the first sample's ranks; AUC = U / (n1 n2).
    auc = (rankdata(values)[truth].sum() - n1 * (n1 + 1) / 2.0) / (n1 * n2)
    return float(max(auc, 1.0 - auc))


def squared_discrepancy(sample: Float, other_sample: Float) -> float:
    """Return the squared maximum mean discrepancy, unbiased, of two samples' rows (N, F) and (M, F).

    Statistics are replaced by their ranks among both, so that no unit and no outlier counts; the kernel is Gaussian,
    as wide as the median distance.
    """
    sample, other_sample = sample[:_MOST_OF_KERNEL], other_sample[:_MOST_OF_KERNEL]
    ranks = rankdata(np.concatenate([sample, other_sample]), axis=0) / (len(sample) + len(other_sample))
    squared = cdist(ranks, ranks, "sqeuclidean")
    kernel = np.exp(-squared / max(float(np.median(squared)), 1e-12))
    n, m = len(sample), len(other_sample)
    # Gretton et al. 2012, unbiased: mean of k(x, x') + mean of k(y, y') - 2 mean of k(x, y), pairs of a row with itself
    # left out; on the diagonal k is 1.
    own_means = [
        (block.sum() - len(block)) / (len(block) * (len(block) - 1)) for block in (kernel[:n, :n], kernel[n:, n:])
    ]
    return float(sum(own_means) - 2.0 * kernel[:n, n:].sum() / (n * m))
