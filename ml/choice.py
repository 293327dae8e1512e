"""The choice of a shipped model for a cloud: by its density, evenness, rings and attributes."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, log
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.arrays import Float, Int
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud

from .cards import ModelCard, Platform, model_names, read_card
from .sweeps import MOST_POINTS, find_sweep

FAR = log(3.0)
"""Distance from a model's domain beyond which its results are doubtful: density three times off, another platform."""
_OTHER_PLATFORM = log(3.0) + 1e-9  # added for another platform: always beyond `FAR`
_UNEVEN = 12.0  # of the 90th to the 20th percentile of cells' points: scanners that stand or drive on the road
_LONG = 3.0  # of a ground-based cloud's extent along to that across: the scanner drove
_DENSE = 60.0  # points/m2 from which an even cloud is a UAV's
_BLOCK = 8
"""Edge of the blocks in which empty square metres are counted, m. Chosen: wider than what hides ground."""
_HIDDEN = 0.05
"""Share of empty square metres from which a dense even cloud was scanned from the road: what stands there hides the
ground behind it. Chosen: even synthetic drives have 0.11 to 0.13, clouds from the air at most 0.03."""
_TALL = 1.0
"""Difference of heights, m, within a square metre from which something stands there: steeper than embankments."""
_BARE = 0.005
"""Share of such square metres up to which nothing stands in a cloud. Measured: none on four published strips of ground
points, from 0.04 on in whole scenes."""
_TELLING = 4.0
"""Points per square metre from which it is told whether anything stands. Chosen: thinner clouds hold single points of
things."""
_SAMPLE = 2_000_000
SQUARE = 24
"""Edge, m, of the squares whose points are counted, so that a sample of them can be drawn. Chosen: that of the tiles
which models label (`segmentation.scoring.EDGE`)."""
CLEARLY = 0.05
"""Difference of two models' agreement with themselves (Cohen's kappa) from which it decides between them. Chosen: on a
labelled street and a labelled sweep, the model with the better classes is 0.01 behind; on a road from the air the model
for sweeps is 0.35 behind."""


@dataclass(frozen=True)
class CloudTraits:
    """Traits of a cloud by which a model is chosen.

    Attributes:
        density: median number of points in occupied square metres, 1/m2.
        unevenness: ratio of the 90th to the 20th percentile of these numbers.
        platform: likely platform of the scanner, judged by density, unevenness, extent, and whether the points
            form the rings of a sweep.
        attributes: names of the points' attributes that vary: ``intensity``, ``color``.
        ground_only: whether nothing stands in the cloud: its points are those of ground and road.
        squares: numbers of usable points by column and row of squares of `SQUARE` m.
    """

    density: float
    unevenness: float
    platform: Platform
    attributes: frozenset[str]
    ground_only: bool = False
    squares: Mapping[tuple[int, int], int] = field(default_factory=dict, repr=False, compare=False)

    def to_text(self) -> str:
        """Return the traits as text."""
        attributes = ", ".join(sorted(self.attributes)) or "no attributes"
        ground = ", ground only" if self.ground_only else ""
        return f"{self.density:.3g} points/m2, {self.platform}{ground}, {attributes}"


@dataclass(frozen=True)
class Choice:
    """A model chosen for a cloud, with the cloud's traits and distance from the model's domain.

    Attributes:
        card: card of the model.
        traits: traits of the cloud.
        distance: distance from the model's domain: 0 inside, else the logarithm of the ratio by which the density is
            outside, plus `_OTHER_PLATFORM` on another platform.
        agreements: Cohen's kappa of each tried model's classes in two views, by its name; empty if none was tried.
    """

    card: ModelCard
    traits: CloudTraits
    distance: float
    agreements: Mapping[str, float] = field(default_factory=dict)

    @property
    def doubtful(self) -> bool:
        """Return whether the cloud lies farther than `FAR` from the model's domain."""
        return self.distance > FAR

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as JSON data."""
        traits = {
            "density": round(self.traits.density, 2),
            "unevenness": round(self.traits.unevenness, 2),
            "platform": self.traits.platform,
            "attributes": sorted(self.traits.attributes),
            "ground_only": self.traits.ground_only,
        }
        data = {"model": self.card.name, "cloud": traits, "distance": round(self.distance, 3), "why": self.why()}
        agreements = {name: round(kappa, 3) for name, kappa in self.agreements.items()}
        return {**data, "agreements": agreements} if agreements else data

    def why(self) -> str:
        """Return one line of text with the chosen model and the reason."""
        least_density, largest_density = self.card.domain.density
        training_domain = (
            f"trained on {least_density:g} to {largest_density:g} points/m2, {' and '.join(self.card.domain.platforms)}"
        )
        reservation = (
            "" if not self.distance else "; the cloud is unlike that" if self.doubtful else "; the nearest there is"
        )
        text = f"{self.card.name} for {self.traits.to_text()}: {training_domain}{reservation}"
        if not self.agreements:
            return text
        figures = ", ".join(f"{name} {kappa:.2f}" for name, kappa in self.agreements.items())
        return f"{text}; on a part labelled from two directions, the models agree with themselves by {figures}"


def choose_model(cloud: Path, task: str) -> Choice:
    """Return the shipped model of a task whose domain is nearest to a cloud.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no cloud, or no model is of use for it.
    """
    cards = [read_card(name) for name in model_names(task)]
    if not cards:
        raise InputError(
            "RUN", None, f"the package has no model for {task}; train one by `synthroads train`, and name its folder"
        )
    traits = cloud_traits(cloud)
    return nearest_model(cards, traits)


def nearest_model(cards: Sequence[ModelCard], traits: CloudTraits) -> Choice:
    """Return the choice of the model (of at least one) whose domain is nearest to a cloud.

    Of equal ones, one for clouds in which nothing stands comes before others, then the first.

    Raises:
        InputError: the cloud lacks attributes that each model needs.
    """
    choices = [Choice(card, traits, domain_distance(card, traits)) for card in cards]
    best_choice = min(choices, key=lambda choice: (choice.distance, not choice.card.domain.ground_only))
    if best_choice.distance == inf:
        missing_attributes = " or ".join(
            sorted({name for card in cards for name in card.domain.needs} - traits.attributes)
        )
        raise InputError("cloud", traits.to_text(), f"the models in the package need clouds with {missing_attributes}")
    return best_choice


def with_agreements(choice: Choice, cards: Sequence[ModelCard], agreements: Mapping[str, float]) -> Choice:
    """Return the choice after models were tried: another model if it agrees with itself `CLEARLY` more.

    Args:
        choice: by the cloud's traits.
        cards: of the models that were tried.
        agreements: Cohen's kappa of each model's classes in two views, by its name.
    """
    best_card = max(cards, key=lambda card: agreements[card.name])
    if agreements[best_card.name] < agreements[choice.card.name] + CLEARLY:
        return replace(choice, agreements=agreements)
    return Choice(best_card, choice.traits, domain_distance(best_card, choice.traits), agreements)


def usable_cards(task: str, traits: CloudTraits) -> list[ModelCard]:
    """Return the cards of the shipped models of a task whose attributes a cloud has, the nearest first."""
    cards = [read_card(name) for name in model_names(task)]
    distances = {card.name: domain_distance(card, traits) for card in cards}
    return sorted((card for card in cards if distances[card.name] < inf), key=lambda card: distances[card.name])


def domain_distance(card: ModelCard, traits: CloudTraits) -> float:
    """Return a cloud's distance from a model's domain (`Choice.distance`).

    Infinite if the cloud lacks needed attributes, or something stands in it and the model knows the ground alone.
    """
    if not set(card.domain.needs) <= traits.attributes or (card.domain.ground_only and not traits.ground_only):
        return inf
    least_density, largest_density = card.domain.density
    density = max(traits.density, 1e-6)
    density_distance = max(0.0, log(least_density / density), log(density / largest_density))
    return density_distance + (0.0 if traits.platform in card.domain.platforms else _OTHER_PLATFORM)


def cloud_traits(path: Path) -> CloudTraits:
    """Return the traits of a cloud file, from all of its points; memory is bounded by the area that they cover.

    Raises:
        MissingFileError: there is no such file.
        InputError: the file is no cloud, or empty.
    """
    cells: dict[tuple[int, int], int] = {}
    heights: dict[tuple[int, int], tuple[float, float]] = {}
    brightest, colorful = 0.0, False
    darkest = inf
    first_blocks: list[Float] = []  # for `find_sweep`, which only takes clouds that are small enough
    with open_cloud(path) as cloud:
        for block in cloud.usable_blocks(_SAMPLE):
            if not len(block):
                continue
            if sum(map(len, first_blocks)) <= MOST_POINTS:
                first_blocks.append(block.xyz)
            plan = np.floor(block.xyz[:, :2]).astype(np.int64)
            cell_corners, cell, counts = np.unique(plan, axis=0, return_inverse=True, return_counts=True)
            low, high = _height_limits(block.xyz[:, 2], cell.reshape(-1), len(counts))
            rows = zip(map(tuple, cell_corners.tolist()), counts.tolist(), low.tolist(), high.tolist(), strict=True)
            for cell_corner, count, lowest, highest in rows:
                cells[cell_corner] = cells.get(cell_corner, 0) + count
                lowest_before, highest_before = heights.get(cell_corner, (inf, -inf))
                heights[cell_corner] = min(lowest, lowest_before), max(highest, highest_before)
            brightest = max(brightest, float(block.intensity.max()))
            darkest = min(darkest, float(block.intensity.min()))
            colorful = colorful or bool(cloud.header.has_color and block.rgb.any())
    if not cells:
        raise InputError(str(path), None, "has no points")
    cell_corners, counts = np.array(list(cells)), np.array(list(cells.values()), dtype=np.float64)
    lower_count, median, upper_count = np.percentile(counts, [20, 50, 90])
    unevenness = float(upper_count / max(lower_count, 1.0))
    squares: Counter[tuple[int, int]] = Counter()
    for (column, row), count in cells.items():
        squares[column // SQUARE, row // SQUARE] += count
    names = (("intensity", brightest > darkest), ("color", colorful))
    return CloudTraits(
        density=float(median),
        unevenness=unevenness,
        platform=_platform(float(median), unevenness, cell_corners.astype(np.float64), first_blocks),
        attributes=frozenset(name for name, is_present in names if is_present),
        ground_only=bool(median >= _TELLING) and _tall_share(list(heights.values())) <= _BARE,
        squares=squares,
    )


def _tall_share(limits: Sequence[tuple[float, float]]) -> float:
    """Return the share of square metres whose least and largest height differ by more than `_TALL`."""
    return sum(highest - lowest > _TALL for lowest, highest in limits) / len(limits)


def _height_limits(height: Float, cell: Int, count: int) -> tuple[Float, Float]:
    """Return the least and largest height of the points (N,) in each of `count` cells, all of which have some."""
    order = np.lexsort((height, cell))
    first = np.searchsorted(cell[order], np.arange(count))
    last = np.append(first[1:], len(order)) - 1
    return height[order][first], height[order][last]


def _platform(density: float, unevenness: float, cell_corners: Float, first_blocks: Sequence[Float]) -> Platform:
    """Return the likely platform: even clouds are seen from above, uneven ones from the road.

    A dense cloud that was thinned is even wherever it was scanned from: its gaps tell.

    Args:
        density: points/m2.
        unevenness: see `CloudTraits`.
        cell_corners: (N, 2) corners of the occupied square metres.
        first_blocks: the cloud's points (N, 3) in blocks, up to the one with which they exceed `MOST_POINTS`; a cloud
            of more points is no sweep.
    """
    if unevenness < _UNEVEN and density < _DENSE:
        return "airborne"
    if unevenness < _UNEVEN and _empty_share(cell_corners) < _HIDDEN:
        return "uav"
    if sum(map(len, first_blocks)) <= MOST_POINTS and find_sweep(np.concatenate(first_blocks)) is not None:
        return "sweep"
    spread = (
        np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(cell_corners.T)), 1.0)) if len(cell_corners) > 2 else np.ones(2)
    )
    return "mobile" if spread[1] > _LONG * spread[0] else "tripod"


def _empty_share(cell_corners: Float) -> float:
    """Return the share of empty square metres in blocks of `_BLOCK` m with neighbours on all sides; 0 without any.

    Args:
        cell_corners: (N, 2) corners of the occupied square metres, each once.
    """
    block_places = np.floor(cell_corners / _BLOCK).astype(np.int64)
    block_places -= block_places.min(axis=0) - 1
    columns = int(block_places[:, 1].max()) + 2
    blocks, counts = np.unique(block_places[:, 0] * columns + block_places[:, 1], return_counts=True)
    steps = [row * columns + column for row in (-1, 0, 1) for column in (-1, 0, 1)]
    is_inner = np.all([np.isin(blocks + step, blocks) for step in steps], axis=0)
    return float(1.0 - counts[is_inner].mean() / _BLOCK**2) if is_inner.any() else 0.0
