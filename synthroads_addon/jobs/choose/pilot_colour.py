"""Pilot measurements of colours: their errors on a few scan lines, and what images cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...blender.cameras import HAS_RETURN_CAMERA, ColourJob, image_views, layer_source
from ...scanning.beam import RINGS
from ...scanning.colour.colour import FROM_MATERIAL, MATERIAL_LAYERS, NEARBY, LayerValues, Targets, sample_targets
from ...scanning.colour.difference import ciede2000, lab
from ...scanning.colour.views import View
from ...scanning.samples import scattered
from ...scenario.colour import image_scale
from ..measure.tradeoff import DENSEST
from ..scan.files import colour_job
from .choice import quantile_bound, ratio_bound
from .pilot import PULSES, Errors, Pilot

Float = NDArray[np.float64]

_LINES = 8
_NEAREST = 3
"""Places of images, nearest in time to a line, that are rendered of each strip."""
_MARGIN = 24
"""Border of what is rendered around a line, px: what is hidden takes its colour from close by."""
_TIMED = 3


def colour_errors(pilot: Pilot, choices: Mapping[str, Mapping[str, Any]], wanted: frozenset[str]) -> dict[str, Errors]:
    """Return the errors of colours and layers by where they come from, see `knobs.colour_choices`.

    The truth is a pixel per return where Blender has it, else the densest images, of the points that these show. Of
    each image only what shows a scan line is rendered.

    Args:
        pilot: of a scene.
        choices: name -> changes of the scenario.
        wanted: ``rgb`` and layers.
    """
    path = scattered(pilot.scan.path, _LINES, PULSES / pilot.scan.setting.shot_rate, pilot.phase)
    found = pilot.results(RINGS[1], path, targets=True)
    lines = [one.seen for one in found if one.seen is not None and len(one.seen)]
    scale = image_scale(pilot.scan.path.typical_range)
    true: dict[str, Any] = {"source": "returns"} if HAS_RETURN_CAMERA else {"source": "images"}
    if not HAS_RETURN_CAMERA:
        true |= {name: scale * length for name, length in DENSEST.items()}
    truth = _values(pilot, true, lines, wanted)
    errors = {}
    for name, changes in choices.items():
        own = {path.removeprefix("colour."): value for path, value in changes.items()}
        mine = truth if own == true else _values(pilot, own, lines, wanted)
        errors[name] = _compared(mine, truth, wanted)
    return errors


def _values(
    pilot: Pilot, changes: Mapping[str, Any], lines: Sequence[Targets], wanted: frozenset[str]
) -> list[LayerValues]:
    job = replace(_job(pilot, changes, wanted), pick=lambda views: near_lines(views, lines))
    with layer_source(job) as source:
        return [sample_targets(source, of, wanted) for of in lines]


def _job(pilot: Pilot, changes: Mapping[str, Any], wanted: frozenset[str]) -> ColourJob:
    colour = type(pilot.scenario.colour).from_dict(pilot.scenario.colour.to_dict() | dict(changes))
    scenario = pilot.scenario.model_copy(update={"colour": colour})
    return replace(colour_job(scenario, pilot.scan, pilot.scene, pilot.air.environment), wanted=wanted)


def near_lines(views: Sequence[View], lines: Sequence[Targets]) -> list[View]:
    """Return what the nearest images show of each scan line: parts of them."""
    parts: list[View | None] = []
    for line in lines:
        away = np.array([np.linalg.norm(view.position - line.scanner.mean(axis=0)) for view in views])
        places = np.unique(np.round(away, 6))[:_NEAREST]
        if not len(places):
            continue
        near = np.flatnonzero(away <= places[-1] + 1e-5)
        parts += [views[number].around(line.position, _MARGIN) for number in near]
    return [part for part in parts if part is not None]


def _compared(mine: Sequence[LayerValues], truth: Sequence[LayerValues], wanted: frozenset[str]) -> Errors:
    """Return CIEDE2000 and the largest RMSE of a layer with their upper bounds, of the points whose truth is known."""
    known = [~np.isin(one.source, (FROM_MATERIAL, NEARBY)) for one in truth]
    result: Errors = {}
    if "rgb" in wanted:
        parts = [
            ciede2000(lab(a.arrays["rgb"][rows]), lab(b.arrays["rgb"][rows]))  # type: ignore[arg-type]
            for a, b, rows in zip(mine, truth, known, strict=True)
        ]
        result["colour"] = quantile_bound(parts, 0.95, "colour")
    layers = [_rmse(name, mine, truth, known) for name in MATERIAL_LAYERS if name in wanted]
    if layers:
        result["layers"] = max(layers, key=lambda pair: pair[1])
    return result


def _rmse(
    name: str, mine: Sequence[LayerValues], truth: Sequence[LayerValues], known: Sequence[NDArray[np.bool_]]
) -> tuple[float, float]:
    squares = [
        np.square(a.arrays[name][rows].astype(np.float64) - b.arrays[name][rows].astype(np.float64))
        for a, b, rows in zip(mine, truth, known, strict=True)
    ]
    total, number = (np.array(values, np.float64) for values in ([s.sum() for s in squares], [s.size for s in squares]))
    estimate, bound = ratio_bound(total, number, name)
    return float(np.sqrt(estimate)), float(np.sqrt(bound))


def image_counts(pilot: Pilot, changes: Mapping[str, Any], wanted: frozenset[str]) -> tuple[int, float]:
    """Return how many images the whole path would have, and their megapixels."""
    own = {path.removeprefix("colour."): value for path, value in changes.items()}
    views = image_views(_job(pilot, own, wanted))
    return len(views), sum(view.pixels for view in views) / 1e6


def image_seconds(pilot: Pilot, changes: Mapping[str, Any], wanted: frozenset[str]) -> tuple[float, float, float]:
    """Render a few images; return seconds before the first, of each image, and of each megapixel."""
    own = {path.removeprefix("colour."): value for path, value in changes.items()}
    sizes: list[float] = []

    def pick(views: list[View]) -> list[View]:
        middle = [views[len(views) * (2 * number + 1) // (2 * _TIMED)] for number in range(_TIMED)] if views else []
        small = [replace(view, size=(max(view.size[0] // 4, 1), max(view.size[1] // 4, 1))) for view in middle[1:]]
        sizes.extend(view.pixels / 1e6 for view in [*middle, *small])
        return [*middle, *small]

    stamps = [pilot.clock()]
    show: Callable[[float], None] = lambda share: stamps.append(pilot.clock())  # noqa: E731
    with layer_source(replace(_job(pilot, own, wanted), pick=pick), progress=show):
        pass
    times = np.diff(stamps)
    if len(times) < 3:
        return 0.0, 0.0, 0.0
    table = np.stack([np.ones(len(sizes) - 1), np.array(sizes[1:])], axis=1)
    (each, pixel), *_ = np.linalg.lstsq(table, times[1:], rcond=None)
    each, pixel = max(float(each), 0.0), max(float(pixel), 0.0)
    return max(float(times[0]) - each - pixel * sizes[0], 0.0), each, pixel
