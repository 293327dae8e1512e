"""Scores against explicit counting, and against scikit-learn."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ml.data.classes import IGNORED
from ml.scores import confusion as confusion_module
from ml.scores.confusion import METRICS, Confusion, score_table, table_by_class, tables_by_test
from ml.scores.metrics import Spread, finite_values
from synthroads_addon.base.errors import InputError
from tests.helpers.page_modules import block_of_page
from tests.judges import require
from tests.judges.learning import scores_that_differ

NAMES = tuple("abcdef")


def random_labels(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return truth without class 4 and predictions without class 3; class 5 occurs in neither; some are ignored."""
    random = np.random.default_rng(seed)
    truth = random.choice([0, 1, 2, 3, IGNORED], 3000, p=[0.5, 0.2, 0.1, 0.1, 0.1])
    return truth, random.choice([0, 1, 2, 4], 3000)


def counted(truth: np.ndarray, predicted: np.ndarray, label: int) -> tuple[float, float, float]:
    """Return precision, recall and IoU of one class by counting sets of points."""
    known = truth != IGNORED
    true = set(np.flatnonzero(known & (truth == label)))
    found = set(np.flatnonzero(known & (predicted == label)))

    def share(whole: int) -> float:
        return len(true & found) / whole if whole else float("nan")

    return share(len(found)), share(len(true)), share(len(true | found))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_scores_are_those_of_counting(seed: int) -> None:
    truth, predicted = random_labels(seed)
    confusion = Confusion(NAMES)
    for part in np.array_split(np.arange(len(truth)), 7):  # one matrix, summed over parts
        confusion.add(truth[part], predicted[part])
    want = np.array([counted(truth, predicted, label) for label in range(len(NAMES))])
    found = np.stack([confusion.values(metric) for metric in ("precision", "recall", "iou")], axis=1)
    np.testing.assert_allclose(found, want, rtol=1e-12)
    assert confusion.support.tolist() == [int((truth == label).sum()) for label in range(len(NAMES))]
    assert confusion.ignored == int((truth == IGNORED).sum())


def test_undefined_scores_are_nan_and_left_out_of_means() -> None:
    truth, predicted = random_labels(4)
    confusion = Confusion(NAMES)
    confusion.add(truth, predicted)
    undefined = {metric: np.flatnonzero(np.isnan(confusion.values(metric))).tolist() for metric in METRICS}
    assert undefined["precision"] == [3, 5]  # never predicted
    assert undefined["recall"] == [4, 5]  # don't occur
    assert undefined["iou"] == [5]  # neither
    assert confusion.values("iou")[3] == 0.0
    assert confusion.values("iou")[4] == 0.0
    assert confusion.to_dict()["mean_iou"] == pytest.approx(np.mean(confusion.values("iou")[:5]))
    assert "-" in score_table(confusion.to_dict()).splitlines()[6]


def test_scores_are_shown_as_they_are() -> None:
    confusion = Confusion(("road", "sign"))
    confusion.add(np.array([0] * 1500 + [1, 1, IGNORED]), np.array([0] * 1500 + [0, 1, 1]))
    lines = [line.split() for line in score_table(confusion.to_dict()).splitlines()]
    assert lines == [
        ["class", "precision", "recall", "IoU", "points"],
        ["road", "99.9", "100.0", "99.9", "1,500"],
        ["sign", "100.0", "50.0", "50.0", "2"],
        ["mean", "100.0", "75.0", "75.0", "1,502"],
        ["99.9", "%", "of", "the", "points", "are", "right,", "1", "without", "a", "class", "left", "out"],
    ]


def test_no_points_give_no_scores() -> None:
    confusion = Confusion(("a", "b"))
    confusion.add(np.array([IGNORED]), np.array([1]))
    result = confusion.to_dict()
    assert np.isnan(confusion.accuracy)
    assert result["mean_iou"] is result["accuracy"] is result["classes"]["a"]["iou"] is None
    json.dumps(result, allow_nan=False)
    assert result["points"] == 0
    assert score_table(result).endswith("- % of the points are right, 1 without a class left out")


def test_wrong_labels_are_refused() -> None:
    confusion = Confusion(("a", "b"))
    with pytest.raises(InputError, match="0 to 1"):
        confusion.add(np.array([2]), np.array([0]))
    with pytest.raises(InputError, match="predicted is -1"):
        confusion.add(np.array([0]), np.array([-1]))
    with pytest.raises(InputError, match="shape"):
        confusion.add(np.array([0]), np.array([0, 1]))


def test_deviation_over_seeds_is_that_of_a_sample() -> None:
    found = Spread.over(finite_values([1.0, 2.0, float("nan"), None, 4.0]))
    assert (found.mean, found.std) == pytest.approx((7 / 3, np.std([1, 2, 4], ddof=1)))
    assert np.isnan(Spread.over([1.0]).std)
    assert np.isnan(Spread.over([]).mean)


@pytest.mark.parametrize("seed", [5, 6])
def test_scores_are_those_of_scikit_learn(seed: int) -> None:
    require("scikit-learn")
    truth, predicted = random_labels(seed)
    known = truth != IGNORED
    confusion = Confusion(NAMES)
    confusion.add(truth, predicted)
    assert scores_that_differ(confusion, truth[known], predicted[known]) == []
    assert len(scores_that_differ(confusion, truth[known], np.roll(predicted[known], 1))) >= 4


def test_classes_that_do_not_occur_have_no_row_and_there_is_no_mean() -> None:
    confusion = Confusion(("a", "b", "c"))
    confusion.add(np.array([0, 0, 1, 1]), np.array([0, 1, 1, 2]))
    text = table_by_class([confusion.to_dict()] * 2)
    assert [line.split("|")[1].strip() for line in text.splitlines()] == ["class", "---", "a", "b"]
    assert "| a | 2 | 100.0 (0.0) | 50.0 (0.0) | 50.0 (0.0) |" in text
    confusion.add(np.array([2]), np.array([2]))
    assert "| mean | 5 |" in table_by_class([confusion.to_dict()])
    assert tables_by_test({"one": {}}).endswith("Seeds: .")


def test_further_rows_end_the_first_tests_table() -> None:
    scores = {"classes": {"a": {"iou": 0.5, "support": 9}}, "mean_iou": 0.5, "points": 9}
    run = {"seen": scores, "unseen": scores}
    row = "| *training, s* |  | 132 (3) | - |"
    lines = tables_by_test({"tuned": {"1": run, "2": run}, "adapted": {"1": run}}, [row]).splitlines()
    assert lines.index(row) + 2 == lines.index("**unseen**")
    assert lines.count("| mean | 9 | 50.0 (0.0) | 50.0 |") == 2
    assert lines[-1] == "Seeds: tuned 2, adapted 1."


def test_a_metric_is_one_entry_that_data_and_tables_have(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = eval(f"{{{block_of_page('extend/effect.md', 'text', 1)}}}", vars(confusion_module))
    monkeypatch.setitem(METRICS, "f1", entry["f1"])
    confusion = Confusion(("a", "b"))
    confusion.add(np.array([0, 0, 0, 1]), np.array([0, 0, 1, 1]))
    scores = confusion.to_dict()
    assert scores["classes"]["a"]["f1"] == pytest.approx(0.8)
    assert scores["mean_f1"] == pytest.approx((0.8 + 2 / 3) / 2)
    assert [line.split()[4] for line in score_table(scores).splitlines()[:3]] == ["F1", "80.0", "66.7"]
    assert table_by_class([scores]).splitlines()[0] == "| class | points | precision | recall | IoU | F1 |"
