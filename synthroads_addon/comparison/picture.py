"""The result of a comparison as a picture: realism by group, and how each statistic is distributed."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arrays import Float
from ..base.figure import new_figure, save_figure
from ..base.files import write_file
from ..base.text.literal import literal_texts
from ..cloud.selection.patches import FEATURES
from .job import CloudComparison, DescribedCloud

_COLUMNS = 6
"""Panels beside each other. Chosen: fit a page."""
_BINS = 40
"""Bars of a histogram. Chosen: a few patches in each."""
_SYNTHETIC, _REAL = "#d6681a", "#5b7aa3"
"""Colours of both sides, told apart by the colour-blind."""
_INCHES = (15.0, 9.0)
"""Width and height of the picture. Chosen: fit a screen."""


@literal_texts()
def save_picture(result: CloudComparison, path: Path, overwrite: bool = False) -> None:
    """Draw a comparison's result and write it as PNG.

    Raises:
        InputError: the file is there already or can't be written.
    """
    figure = new_figure(*_INCHES)
    rows = -(-(len(FEATURES) + 1) // _COLUMNS)
    axes = figure.subplots(rows, _COLUMNS).ravel()
    _draw_groups(axes[0], result)
    figure.legend(loc="outside upper center", ncols=2)
    for number, name in enumerate(FEATURES):
        _draw_feature(axes[number + 1], result, number, name)
    for unused_axes in axes[len(FEATURES) + 1 :]:
        unused_axes.set_axis_off()
    data = io.BytesIO()
    save_figure(figure, data, dpi=100)
    write_file(path, data.getvalue(), overwrite=overwrite)


def _draw_groups(axes: Any, result: CloudComparison) -> None:
    """Draw bars of the mean AUC of each group, of synthetic clouds and of real ones."""
    groups = list(result.distinctions[0].auc)
    for shift, rows, colour, label in (
        (-0.2, result.distinctions, _SYNTHETIC, "synthetic"),
        (0.2, result.yardstick, _REAL, "real, each from the others"),
    ):
        auc = [[distinction.auc[group] for distinction in rows] for group in groups]
        axes.barh(np.arange(len(groups)) + shift, np.mean(auc, axis=1), 0.38, color=colour, label=label)
    axes.set(yticks=range(len(groups)), yticklabels=groups, xlim=(0.5, 1.0), title="told apart (AUC)")
    axes.invert_yaxis()


def _draw_feature(axes: Any, result: CloudComparison, number: int, name: str) -> None:
    """Draw the histograms of one statistic over the patches of synthetic and real clouds."""
    sides = [_values(clouds, number) for clouds in (result.synthetic, result.real)]
    lower_limit, upper_limit = np.quantile(np.concatenate(sides), (0.005, 0.995))
    edges = np.linspace(lower_limit, max(upper_limit, lower_limit + 1e-9), _BINS)
    for values, colour in zip(sides, (_SYNTHETIC, _REAL), strict=True):
        axes.hist(np.clip(values, lower_limit, upper_limit), edges, density=True, color=colour, alpha=0.6)
    synthetic_auc, real_auc = result.giveaways()[name]
    axes.set_title(f"{name.replace('_', ' ')}\nAUC {synthetic_auc:.2f}, real {real_auc:.2f}", fontsize=8)
    axes.set_yticks([])
    axes.tick_params(labelsize=7)


def _values(clouds: tuple[DescribedCloud, ...], number: int) -> Float:
    """Return one statistic, by its column number, of all patches of some clouds (P,)."""
    return np.concatenate([cloud.patches.values[:, number] for cloud in clouds])
