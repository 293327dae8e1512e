"""The choice of a shipped model for a cloud: by what can be measured on any, density, evenness and attributes."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, log
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud

from .cards import ModelCard, Platform, model_names, read_card

FAR = log(3.0)
"""Distance from a model's domain beyond which its results are doubtful: density three times off, another platform."""
_OTHER_PLATFORM = log(3.0) + 1e-9
_UNEVEN = 12.0  # of the 90th to the 20th percentile of cells' points: scanners that stand or drive on the road
_LONG = 3.0  # of a ground-based cloud's extent along to that across: the scanner drove
_DENSE = 60.0  # points/m2 from which an even cloud is a UAV's
_SAMPLE = 2_000_000


@dataclass(frozen=True)
class CloudTraits:
    """Traits of a cloud by which a model is chosen.

    Attributes:
        density: median of the points in occupied square metres.
        unevenness: ratio of the 90th to the 20th percentile of the same.
        platform: that the scanner was on, judged by the two and the extent.
        attributes: of the points that tell something: ``intensity``, ``color``.
    """

    density: float
    unevenness: float
    platform: Platform
    attributes: frozenset[str]

    def to_text(self) -> str:
        """Return the traits as text."""
        told = ", ".join(sorted(self.attributes)) or "no attributes"
        return f"{self.density:.3g} points/m2, {self.platform}, {told}"


@dataclass(frozen=True)
class Choice:
    """A chosen model, and why.

    Attributes:
        card: of the model.
        traits: of the cloud.
        distance: from what the model was trained on: 0 inside, the logarithm of how many times the density is off
            outside, and more on another platform.
    """

    card: ModelCard
    traits: CloudTraits
    distance: float

    @property
    def doubtful(self) -> bool:
        """Return whether the cloud is too far from what the model was trained on."""
        return self.distance > FAR

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as JSON data."""
        traits = {
            "density": round(self.traits.density, 2),
            "unevenness": round(self.traits.unevenness, 2),
            "platform": self.traits.platform,
            "attributes": sorted(self.traits.attributes),
        }
        return {"model": self.card.name, "cloud": traits, "distance": round(self.distance, 3), "why": self.why()}

    def why(self) -> str:
        """Return in one line which model was chosen and why."""
        low, high = self.card.domain.density
        trained = f"trained on {low:g} to {high:g} points/m2, {' and '.join(self.card.domain.platforms)}"
        beside = (
            "" if not self.distance else "; the cloud is unlike that" if self.doubtful else "; the nearest there is"
        )
        return f"{self.card.name} for {self.traits.to_text()}: {trained}{beside}"


def choose_model(cloud: Path, task: str) -> Choice:
    """Return the shipped model of a task that was trained on what is most like a cloud.

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
    return nearest(cards, traits)


def nearest(cards: Sequence[ModelCard], traits: CloudTraits) -> Choice:
    """Return which of some models (at least one) was trained on what is most like a cloud; of equal ones the first.

    Raises:
        InputError: the cloud lacks what each of them needs.
    """
    choices = [Choice(card, traits, domain_distance(card, traits)) for card in cards]
    best = min(choices, key=lambda choice: choice.distance)
    if best.distance == inf:
        needed = " or ".join(sorted({name for card in cards for name in card.domain.needs} - traits.attributes))
        raise InputError("cloud", traits.to_text(), f"the models in the package need clouds with {needed}")
    return best


def domain_distance(card: ModelCard, traits: CloudTraits) -> float:
    """Return how far a cloud is from what a model was trained on; infinite if it lacks what the model needs."""
    if not set(card.domain.needs) <= traits.attributes:
        return inf
    low, high = card.domain.density
    density = max(traits.density, 1e-6)
    beside = max(0.0, log(low / density), log(density / high))
    return beside + (0.0 if traits.platform in card.domain.platforms else _OTHER_PLATFORM)


def cloud_traits(path: Path) -> CloudTraits:
    """Return the traits of a cloud file, from all of its points; memory is bounded by the area that they cover.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no cloud, or empty.
    """
    cells: dict[tuple[int, int], int] = {}
    brightest, colorful = 0.0, False
    darkest = inf
    with open_cloud(path) as cloud:
        for block in cloud.usable_blocks(_SAMPLE):
            if not len(block):
                continue
            plan = np.floor(block.xyz[:, :2]).astype(np.int64)
            places, counts = np.unique(plan, axis=0, return_counts=True)
            for place, count in zip(map(tuple, places.tolist()), counts.tolist(), strict=True):
                cells[place] = cells.get(place, 0) + count
            brightest = max(brightest, float(block.intensity.max()))
            darkest = min(darkest, float(block.intensity.min()))
            colorful = colorful or bool(cloud.header.has_color and block.rgb.any())
    if not cells:
        raise InputError(str(path), None, "has no points")
    places, counts = np.array(list(cells)), np.array(list(cells.values()), dtype=np.float64)
    low, median, high = np.percentile(counts, [20, 50, 90])
    unevenness = float(high / max(low, 1.0))
    names = (("intensity", brightest > darkest), ("color", colorful))
    return CloudTraits(
        density=float(median),
        unevenness=unevenness,
        platform=_platform(float(median), unevenness, places.astype(np.float64)),
        attributes=frozenset(name for name, there in names if there),
    )


def _platform(density: float, unevenness: float, places: np.ndarray[Any, np.dtype[np.float64]]) -> Platform:
    """Return the likely platform: even clouds are seen from above, uneven ones from the road."""
    if unevenness < _UNEVEN:
        return "uav" if density >= _DENSE else "airborne"
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(places.T)), 1.0)) if len(places) > 2 else np.ones(2)
    return "mobile" if spread[1] > _LONG * spread[0] else "tripod"
