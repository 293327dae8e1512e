"""Measure what training on synthetic clouds is worth for telling markings from pavement, point by point.

    python studies/realism/markings.py CLOUD [CLOUD ...] --real real.yaml

A small network (`effects.py`) learns on synthetic clouds together to tell a marking's points from the pavement's by
their brightness and their neighbours', and is asked about each real cloud. Beside its balanced accuracy stand Otsu's
threshold on the real cloud's own brightness, which has learned nothing, and the same network trained on the other real
clouds. A second table says how marking and pavement overlap: percentiles of the marking over the pavement's median, and
the share of the marking's points that are no brighter than the brightest twentieth of the pavement's. Both tables are
printed in Markdown.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sklearn.metrics import balanced_accuracy_score

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.realism.effects import MARKING, network_score, points_of  # noqa: E402
from synthroads_addon.base.arrays import Float, Index, otsu_threshold  # noqa: E402
from synthroads_addon.comparison.clouds import ROAD, ComparedCloud, find_clouds, read_compared  # noqa: E402

_PERCENTILES = (5.0, 25.0, 50.0, 75.0, 95.0)

Points = tuple[Float, Index]
"""Features (N, F) of points, of which the first is their brightness, and which are of markings (N,)."""


def otsu_score(points: Points) -> float:
    """Return the balanced accuracy of Otsu's threshold of the points' brightness in dB."""
    level, label = points[0][:, 0], points[1]
    return float(balanced_accuracy_score(label, level > otsu_threshold(level)))


def joined(parts: Sequence[Points]) -> Points:
    """Return the points of several clouds as one set."""
    return np.concatenate([features for features, _ in parts]), np.concatenate([label for _, label in parts])


def levels(cloud: ComparedCloud) -> tuple[Float, Float]:
    """Return the levels (N,) of all points of the pavement, and (M,) of all of its markings, over its median, dB."""
    road, marking = (10.0 * np.log10(cloud.classes[name].intensity) for name in (ROAD, MARKING))
    return road - np.median(road), marking - np.median(road)


def score_table(synthetic: Sequence[Points], real: dict[str, Points]) -> str:
    """Return the balanced accuracies on each real cloud as a Markdown table."""
    lines = ["| real cloud | trained on synthetic clouds | Otsu's threshold | trained on the other real clouds |"]
    lines += ["|---|--:|--:|--:|"]
    rows = []
    for name, points in real.items():
        others = [other_points for other_name, other_points in real.items() if other_name != name]
        trained = network_score(joined(synthetic), [points])
        rows.append((trained, otsu_score(points), network_score(joined(others), [points])))
        lines.append(f"| {name} | " + " | ".join(f"{score:.3f}" for score in rows[-1]) + " |")
    means = np.mean(rows, axis=0)
    lines.append("| mean | " + " | ".join(f"{score:.3f}" for score in means) + " |")
    return "\n".join(lines)


def overlap_table(clouds: Sequence[ComparedCloud]) -> str:
    """Return how markings and pavement overlap in brightness as a Markdown table."""
    lines = [
        "| cloud | marking over the pavement's median, dB: " + ", ".join(f"{p:g} %" for p in _PERCENTILES) + " | "
        "pavement, 95 % | marking below that |",
        "|---|--:|--:|--:|",
    ]
    for cloud in clouds:
        road, marking = levels(cloud)
        bright = float(np.percentile(road, 95.0))
        shown = ", ".join(f"{value:.1f}" for value in np.percentile(marking, _PERCENTILES))
        lines.append(f"| {cloud.name} | {shown} | {bright:.2f} | {100.0 * np.mean(marking <= bright):.1f} % |")
    return "\n".join(lines)


def main() -> None:
    """Print both tables of the command line's clouds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", type=Path, nargs="+", metavar="CLOUD")
    parser.add_argument("--real", type=Path, required=True, metavar="LIST", help="real clouds, see docs/compare.md")
    arguments = parser.parse_args()
    synthetic = [read_compared(path, row) for cloud in arguments.clouds for path, row in find_clouds(cloud)]
    real = [read_compared(path, row) for path, row in find_clouds(arguments.real)]
    print(score_table([points_of(cloud) for cloud in synthetic], {cloud.name: points_of(cloud) for cloud in real}))
    print()
    print(overlap_table([*synthetic, *real]))


if __name__ == "__main__":
    main()
