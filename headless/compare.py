"""Compare synthetic clouds with real ones: statistics side by side, and how well a classifier separates the two.

Each argument is a cloud, a folder of clouds, or a list (.yaml, .json) that says where each cloud's classes are.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from headless.commands import Outcome, entry
from headless.messages import logger
from headless.pictures import can_draw
from headless.progress import progress_bar
from synthroads_addon.base.files import output_folder
from synthroads_addon.base.remarks import remarks_so_far
from synthroads_addon.base.schema import canonical_json

REPORT, PICTURE = "comparison.json", "comparison.png"
_GIVEAWAYS = 5
_NO_CLASSIFIER = (
    "clouds are compared by their statistics alone: the classifier, which says how surely they are told apart, "
    "needs the package scikit-learn: pip install 'synthroads[ml]'"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `synthroads compare` to its parser."""
    parser.add_argument("synthetic", type=Path, metavar="SYNTHETIC", help="cloud, folder or list of clouds to judge")
    parser.add_argument(
        "real", type=Path, metavar="REAL", help="cloud, folder or list of real clouds; two or more give a reference"
    )
    parser.add_argument("--output", required=True, type=Path, metavar="DIR", help="folder for report and picture")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the choice of patches and folds (1)")
    parser.add_argument("--overwrite", action="store_true", help="replace files that are already there")


def run(arguments: argparse.Namespace) -> Outcome:
    """Run `synthroads compare`; return exit code, result as JSON data and printed text."""
    from synthroads_addon.comparison.classifier import has_classifier
    from synthroads_addon.comparison.job import compare

    has_picture = can_draw(PICTURE)
    if not has_classifier():
        logger.info(_NO_CLASSIFIER)
    with output_folder(arguments.output, [REPORT, PICTURE], arguments.overwrite) as folder:
        result = compare(arguments.synthetic, arguments.real, arguments.seed, progress_bar(arguments))
        data = result.to_dict() | {"remarks": remarks_so_far()}
        (folder / REPORT).write_text(canonical_json(data), encoding="utf-8")
        if has_picture:
            from synthroads_addon.comparison.picture import save_picture

            save_picture(result, folder / PICTURE, overwrite=True)
    return 0, data, summary(data, arguments.output)


def summary(data: dict[str, Any], output: Path) -> str:
    """Return a comparison's result as text: AUC of telling clouds apart, realism, and the most telling features."""
    lines = []
    for side in ("synthetic", "real"):
        for row in data[side]:
            figures_text = f"told from {'the' if side == 'synthetic' else 'the other'} real ones by "
            figures_text += ", ".join(f"{group} {value:.2f}" for group, value in row["auc"].items())
            lines.append(f"{side} {row['cloud']}: {figures_text if row['auc'] else str(row['patches']) + ' patches'}")
    if shares := ", ".join(f"{group} {value:.2f}" for group, value in data["realism"].items()):
        lines.append(f"realism, 1 where a real cloud is told apart as surely: {shares}")
    lines.append(f"density-aware Chamfer distance of patches, over that of real ones: {data['chamfer']:.2f}")
    for name, (figures_text, real) in list(data["giveaways"].items())[:_GIVEAWAYS]:
        medians = [", ".join(f"{row['medians'][name]:.3g}" for row in data[side]) for side in ("synthetic", "real")]
        lines.append(f"  {name} gives away {figures_text:.2f} (real {real:.2f}): {medians[0]} against {medians[1]}")
    return "\n".join([*lines, f"written to {output}"])


if __name__ == "__main__":
    entry("compare")
