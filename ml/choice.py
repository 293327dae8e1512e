"""The choice of a shipped model for a cloud: by its density, evenness, rings and attributes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, log
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.base.errors import InputError
from synthroads_addon.cloud.formats.registry import open_cloud

from .cards import ModelCard, Platform, model_names, read_card
from .sweeps import MOST_POINTS, find_sweep

FAR = log(3.0)
"""Distance from a model's domain beyond which its results are doubtful: density three times off, another platform."""
_OTHER_PLATFORM = log(3.0) + 1e-9
_UNEVEN = 12.0  # of the 90th to the 20th percentile of cells' points: scanners that stand or drive on the road
_LONG = 3.0  # of a ground-based cloud's extent along to that across: the scanner drove
_DENSE = 60.0  # points/m2 from which an even cloud is a UAV's
_SAMPLE = 2_000_000
CLEARLY = 0.05
"""Difference of two models' agreement with themselves (Cohen's kappa) from which it decides between them. Chosen: on a
labelled street and a labelled sweep, the model with the better classes is 0.01 behind; on a road from the air the model
for sweeps is 0.35 behind."""


@dataclass(frozen=True)
class CloudTraits:
    """Traits of a cloud by which a model is chosen.

    Attributes:
        density: median of the points in occupied square metres.
        unevenness: ratio of the 90th to the 20th percentile of the same.
        platform: that the scanner was on, judged by the two, the extent, and whether the points lie in a sweep's rings.
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
        agreements: by how much each model that was tried agrees with itself, by its name; none where none was tried.
    """

    card: ModelCard
    traits: CloudTraits
    distance: float
    agreements: Mapping[str, float] = field(default_factory=dict)

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
        data = {"model": self.card.name, "cloud": traits, "distance": round(self.distance, 3), "why": self.why()}
        tried = {name: round(value, 3) for name, value in self.agreements.items()}
        return {**data, "agreements": tried} if tried else data

    def why(self) -> str:
        """Return in one line which model was chosen and why."""
        low, high = self.card.domain.density
        trained = f"trained on {low:g} to {high:g} points/m2, {' and '.join(self.card.domain.platforms)}"
        beside = (
            "" if not self.distance else "; the cloud is unlike that" if self.doubtful else "; the nearest there is"
        )
        text = f"{self.card.name} for {self.traits.to_text()}: {trained}{beside}"
        if not self.agreements:
            return text
        figures = ", ".join(f"{name} {value:.2f}" for name, value in self.agreements.items())
        return f"{text}; tried on a part seen from two directions, the models agree with themselves by {figures}"


def choose_model(cloud: Path, task: str) -> Choice:
    """Return the shipped model of a task that was trained on what is most like a cloud.

    Raises:
        MissingFileError: there is no such file.
        InputError: it is no cloud, or no model is of use for it.
    """
    cards = [read_card(name) for name in model_names(task)]
    if not cards:
        raise InputError("RUN", None, f"no model for {task} comes with the package; `synthroads train` makes one")
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
        raise InputError("cloud", traits.to_text(), f"the models that come with the package need {needed}")
    return best


def with_agreements(choice: Choice, cards: Sequence[ModelCard], agreements: Mapping[str, float]) -> Choice:
    """Return the choice after models were tried: another model if it agrees with itself `CLEARLY` more.

    Args:
        choice: by the cloud's traits.
        cards: of the models that were tried.
        agreements: Cohen's kappa of each model's classes in two views, by its name.
    """
    best = max(cards, key=lambda card: agreements[card.name])
    if agreements[best.name] < agreements[choice.card.name] + CLEARLY:
        return replace(choice, agreements=agreements)
    return Choice(best, choice.traits, domain_distance(best, choice.traits), agreements)


def usable_cards(task: str, traits: CloudTraits) -> list[ModelCard]:
    """Return the cards of the shipped models of a task whose attributes a cloud has, the nearest first."""
    cards = [read_card(name) for name in model_names(task)]
    distances = {card.name: domain_distance(card, traits) for card in cards}
    return sorted((card for card in cards if distances[card.name] < inf), key=lambda card: distances[card.name])


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
    head: list[Float] = []  # points, as long as there are few enough for a sweep
    with open_cloud(path) as cloud:
        for block in cloud.usable_blocks(_SAMPLE):
            if not len(block):
                continue
            if sum(map(len, head)) <= MOST_POINTS:
                head.append(block.xyz)
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
        platform=_platform(float(median), unevenness, places.astype(np.float64), head),
        attributes=frozenset(name for name, there in names if there),
    )


def _platform(density: float, unevenness: float, places: Float, head: Sequence[Float]) -> Platform:
    """Return the likely platform: even clouds are seen from above, uneven ones from the road.

    Args:
        density: points/m2.
        unevenness: see `CloudTraits`.
        places: (N, 2) occupied square metres.
        head: the cloud's points (N, 3) in blocks; of a cloud of over `MOST_POINTS`, which is no sweep, some of them.
    """
    if unevenness < _UNEVEN:
        return "uav" if density >= _DENSE else "airborne"
    if sum(map(len, head)) <= MOST_POINTS and find_sweep(np.concatenate(head)) is not None:
        return "sweep"
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(places.T)), 1.0)) if len(places) > 2 else np.ones(2)
    return "mobile" if spread[1] > _LONG * spread[0] else "tripod"
