"""Judges of learning: scores judged by scikit-learn, the network by its authors' openpoints."""

from __future__ import annotations

import sys
from importlib import metadata, util
from pathlib import Path

import numpy as np

from tests.judges import bringing
from tests.judges.samples import Samples

OPENPOINTS = "0.1.2"
OPENPOINTS_FOLDER = bringing.BUILD / "openpoints"


def sklearn_verdict(samples: Samples) -> list[str]:
    """Return the scores of labels drawn at random that scikit-learn counts differently."""
    from ml.scores.confusion import Confusion

    rng = np.random.default_rng(5)
    truth, predicted = rng.integers(0, 6, (2, 4000))
    confusion = Confusion(tuple("abcdef"))
    confusion.add(truth, predicted)
    return scores_that_differ(confusion, truth, predicted)


def scores_that_differ(confusion: object, truth: np.ndarray, predicted: np.ndarray) -> list[str]:
    """Return the scores of a `Confusion` that scikit-learn counts differently from the same labels (N,)."""
    from sklearn import metrics

    labels = list(range(len(confusion.names)))
    precision, recall, _, support = metrics.precision_recall_fscore_support(
        truth, predicted, labels=labels, zero_division=np.nan
    )
    defined = ~np.isnan(confusion.values("iou"))  # scikit-learn's IoU has no NaN for classes that occur nowhere
    iou = metrics.jaccard_score(truth, predicted, labels=labels, average=None, zero_division=0)
    pairs = {
        "counts": (confusion.counts, metrics.confusion_matrix(truth, predicted, labels=labels)),
        "precision": (confusion.values("precision"), precision),
        "recall": (confusion.values("recall"), recall),
        "support": (confusion.support, support),
        "IoU": (confusion.values("iou")[defined], iou[defined]),
    }
    return [f"{name}: {a} and not {b}" for name, (a, b) in pairs.items() if not np.allclose(a, b, equal_nan=True)]


def openpoints_folder() -> Path:
    """Return the folder of the installed package, the environment's or the one that was brought."""
    spec = util.find_spec("openpoints")
    return Path(spec.origin).parent if spec and spec.origin else OPENPOINTS_FOLDER / "openpoints"


def openpoints_version() -> str | None:
    """Return the version of openpoints; None if it isn't here, or without PyTorch."""
    if util.find_spec("torch") is None:
        return None
    where = openpoints_folder().parent
    return next((found.version for found in metadata.distributions(name="openpoints", path=[str(where)])), None)


def bring_openpoints() -> None:
    """Download it without what it needs for data sets and CUDA."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    bringing.install(OPENPOINTS_FOLDER, [*pip, "--target", "{}", f"openpoints=={OPENPOINTS}"])


def openpoints_verdict(samples: Samples) -> list[str]:
    """Return in what the smallest network differs from the authors': parameters, outputs, gradients, statistics."""
    from ml.networks.segmentation.pointnext import PointNeXtOptions
    from tests.judges import pointnext_reference as reference

    with reference.openpoints_modules(openpoints_folder()) as modules:
        theirs = reference.Theirs(modules, PointNeXtOptions(preset="S"))
        count = sum(weight.numel() for weight in theirs.parameters())
        found = [] if count == reference.PUBLISHED["S"] else [f"{count} parameters"]
        differences = reference.compared(modules, reference.same_as_theirs("S"), 1100, training=True)
    return found + [f"{name}: {value:.1e}" for name, value in differences.items() if value > 1e-6]
