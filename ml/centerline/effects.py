"""Effects on sequences of slices, drawn while training: cheap, and carried along to the truth.

Every effect takes its random numbers from the sample's own stream, so that a seed and a number give the same sample,
whatever worker makes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ml.configuration import Part
from synthroads_addon.core.schema import quantity

from .corridor import CORRIDOR
from .frames import Frames

Float = NDArray[np.float64]
Generator = np.random.Generator

_DARKEST = 1e-5
"""Intensities below this share of the brightest count as it."""
_NARROWEST = 0.02
"""A footprint narrower than this is a point, m."""
_LINE_REACH = 0.5
"""Paint within so far of a line's place is the line's, m."""
_NO_SHOULDER = 1.2
"""Pavement beyond an edge line that is no shoulder yet, m."""
_LINE_WIDTHS = (0.12, 0.6)
"""Of a solid lane line: one narrow line to a double one with what lies between, m."""
_SCANNER_HEIGHTS = (1.5, 60.0)
_SCANNER_ASIDE = 15.0
"""Of the scanners from whose range intensities fall off: lowest and highest, and farthest from the path, m."""

LEFT, RIGHT, HEADING, HEIGHT = (CORRIDOR.index(name) for name in ("left_edge", "right_edge", "heading", "height"))


@dataclass
class Stretch:
    """A sequence of S slices with K points; effects change it in place.

    Attributes:
        xyz: (K, 3) float64 in the slices' frames, m; z still that of the cloud.
        number: (K,) slice of each point, ascending.
        intensity: (K,) float64, 0 where there is none.
        rgb: (K, 3) float64 from 0 to 1.
        paved, marked: (K,) whether a point is known to lie on the pavement (markings included), or on a marking.
        has_color: whether the colours mean something.
        frames: the S frames.
        center: (S,) y of the true centreline, m, or NaN.
        corridor: (S, len(CORRIDOR)); height is above the cloud's zero.
        lines, room: (S, 2) see `Crossings`.
    """

    xyz: Float
    number: NDArray[np.intp]
    intensity: Float
    rgb: Float
    paved: NDArray[np.bool_]
    marked: NDArray[np.bool_]
    has_color: bool
    frames: Frames
    center: Float
    corridor: Float
    lines: Float
    room: Float

    def keep(self, points: NDArray[np.bool_] | NDArray[np.intp]) -> None:
        """Leave out all points but those of a mask or of ascending indices."""
        for name in ("xyz", "number", "intensity", "rgb", "paved", "marked"):
            setattr(self, name, getattr(self, name)[points])


class Crop(Part):
    """Both sides of every slice cut off, so that the middle of what is left isn't the centre.

    A strip reaches to a distance R from the true centre to either side, two numbers drawn for the whole sequence: a
    road's from ``reach``, a carriageway's from its edge line out to ``beyond`` farther, but at most to the middle of
    the median. In it every slice, and each of its sides by itself, is cut to a distance between (1 - ``share``) R and
    R; with the probability ``steady`` the same in all slices, since cuts of their own average out over a sequence. What
    isn't cut is seen as far as slices reach, as in scans of whole landscapes.
    """

    probability: float = quantity(0.7, ge=0, le=1, unit="1", description="Of a sequence.")
    reach: tuple[float, float] = Field((4.0, 30.0), description="Smallest and largest R of a road's strip, m.")
    beyond: tuple[float, float] = Field((0.0, 4.0), description="R of a carriageway's strip beyond its edge line, m.")
    share: float = quantity(0.75, ge=0, le=0.95, unit="1", description="Largest part of R that is cut off.")
    steady: float = quantity(0.25, ge=0, le=1, unit="1", description="Probability of cuts that all slices share.")

    @model_validator(mode="after")
    def _in_order(self) -> Crop:
        for name, least in (("reach", 0.5), ("beyond", 0.0)):
            low, high = getattr(self, name)
            if not least <= low <= high <= 1000.0:
                raise ValueError(f"{name} must be two ascending numbers from {least:g} to 1000")
        return self


class Effects(Part):
    """What is done to a sequence while training. Strengths are the largest; each sample draws its own below them."""

    mirror: float = quantity(0.5, ge=0, le=1, unit="1", description="Probability of left and right being swapped.")
    turn_round: float = quantity(0.5, ge=0, le=1, unit="1", description="Probability of running against the path.")
    crop: Crop = Field(default=Crop(), description="Sides cut off.")
    dropout: float = quantity(0.3, ge=0, lt=1, unit="1", description="Share of the points that are left out.")
    hidden: float = quantity(0.2, ge=0, le=1, unit="1", description="Probability of a hole as behind a vehicle.")
    empty: float = quantity(0.02, ge=0, le=1, unit="1", description="Probability of a slice without any point.")
    jitter: float = quantity(0.02, ge=0, le=1, unit="m", description="Standard deviation of the points' noise.")
    footprint: float = quantity(1.2, ge=0, le=5, unit="m", description="Width across which intensities are means.")
    tilt: float = quantity(0.01, ge=0, le=0.2, unit="1", description="Cross slope and grade that are added.")
    plain: float = quantity(0.25, ge=0, le=1, unit="1", description="Probability of intensities as they are.")
    contrast: float = quantity(1.5, ge=0, le=3, unit="1", description="Log of the factor on what isn't pavement.")
    paint: float = quantity(0.95, ge=0, le=1, unit="1", description="Share of the markings' brightness worn off.")
    repaint: float = quantity(
        0.3,
        ge=0,
        le=0.5,
        unit="1",
        description="Probability that the lane line of a carriageway without shoulders is solid, that it is worn off, "
        "that both edge lines are, and that one of them is.",
    )
    gamma: tuple[float, float] = Field((0.15, 1.5), description="Smallest and largest power of the intensities.")
    falloff: float = quantity(
        4.0, ge=0, le=10, unit="1", description="Power of the range fall-off from scanners somewhere above the road."
    )
    stripes: float = quantity(0.3, ge=0, le=2, unit="1", description="As speckle, of wheel tracks, joints and lanes.")
    speckle: float = quantity(0.3, ge=0, le=2, unit="1", description="Noise of intensities by their own p90 - p10.")
    patches: float = quantity(0.2, ge=0, le=2, unit="1", description="The same of patches some metres long and wide.")
    colorless: float = quantity(0.3, ge=0, le=1, unit="1", description="Probability of the colours being left out.")
    tint: float = quantity(0.2, ge=0, le=1, unit="1", description="Log of the factor on each colour channel.")

    @model_validator(mode="after")
    def _powers(self) -> Effects:
        if not 0.01 <= self.gamma[0] <= self.gamma[1] <= 10.0:
            raise ValueError("gamma must be two ascending numbers from 0.01 to 10")
        return self


def leave_out(stretch: Stretch, effects: Effects, rng: Generator, carriageway: bool) -> None:
    """Draw the effects that leave points out.

    Args:
        stretch: is changed in place.
        effects: their strengths.
        rng: the sample's own stream.
        carriageway: whether the truth is a carriageway's, beside which the other one must not be seen.
    """
    crop_sides(stretch, effects.crop, rng, carriageway)
    drop(stretch, effects, rng)


def transform(stretch: Stretch, effects: Effects, rng: Generator) -> None:
    """Draw the effects that change points. They cost the less the fewer points are left."""
    for happens, turned in ((effects.mirror, mirror), (effects.turn_round, turn_round)):
        if rng.random() < happens:
            turned(stretch)
    move(stretch, effects, rng)
    relight(stretch, effects, rng)


def crop_sides(stretch: Stretch, crop: Crop, rng: Generator, carriageway: bool) -> None:
    """Cut off both sides of every slice; slices without a known centre are cut as if it lay at the frame's origin."""
    count = len(stretch.center)
    center = np.nan_to_num(stretch.center)
    if rng.random() >= crop.probability:
        return
    if carriageway:
        # Points beyond the middle of the median aren't there in the first place.
        strip = np.nan_to_num(stretch.lines, nan=3.5) + rng.uniform(*crop.beyond, 2)
        strip = np.minimum(strip, np.nan_to_num(stretch.room, nan=np.inf))
    else:
        # Uniform logarithms: narrow strips differ more from each other than wide ones.
        low, high = np.log(crop.reach)
        strip = np.tile(np.exp(rng.uniform(low, high, 2)), (count, 1))
    reach = strip * (1.0 - rng.uniform(0.0, crop.share, (1 if rng.random() < crop.steady else count, 2)))
    y = stretch.xyz[:, 1] - center[stretch.number]
    stretch.keep((y <= reach[stretch.number, 0]) & (-y <= reach[stretch.number, 1]))


def drop(stretch: Stretch, effects: Effects, rng: Generator) -> None:
    """Leave out single points, whole slices, and a hole of some metres."""
    slices, points = len(stretch.center), len(stretch.number)
    keep = rng.random(points) >= rng.uniform(0.0, effects.dropout)
    keep &= (rng.random(slices) >= effects.empty)[stretch.number]
    if rng.random() < effects.hidden and points:
        at, length, width = rng.integers(points), rng.uniform(2.0, 12.0), rng.uniform(1.5, 3.0)
        along = np.abs(stretch.number - stretch.number[at]) <= length / 2.0
        keep &= ~(along & (np.abs(stretch.xyz[:, 1] - stretch.xyz[at, 1]) <= width / 2.0))
    stretch.keep(keep)


def mirror(stretch: Stretch) -> None:
    """Swap left and right. The frames are mirrored as well, so that a mirrored sample has no way back to the cloud."""
    frames = stretch.frames
    stretch.frames = Frames(frames.position * np.array([1.0, -1.0]), -frames.direction, frames.station)
    stretch.xyz = stretch.xyz * np.array([1.0, -1.0, 1.0])
    stretch.center = -stretch.center
    corridor = stretch.corridor.copy()
    corridor[:, LEFT], corridor[:, RIGHT] = -stretch.corridor[:, RIGHT], -stretch.corridor[:, LEFT]
    corridor[:, HEADING] *= -1.0
    stretch.corridor = corridor
    stretch.lines, stretch.room = stretch.lines[:, ::-1], stretch.room[:, ::-1]


def turn_round(stretch: Stretch) -> None:
    """Run along the road in the other direction, the last slice first."""
    last = len(stretch.center) - 1
    order = np.argsort(last - stretch.number, kind="stable")
    stretch.keep(order)
    stretch.number = last - stretch.number
    stretch.xyz = stretch.xyz * np.array([-1.0, -1.0, 1.0])
    stretch.center = -stretch.center[::-1]
    corridor = stretch.corridor[::-1].copy()
    corridor[:, [LEFT, RIGHT]] = -corridor[:, [RIGHT, LEFT]]
    stretch.corridor = corridor
    stretch.lines, stretch.room = stretch.lines[::-1, ::-1], stretch.room[::-1, ::-1]
    stretch.frames = stretch.frames.turned_round()


def move(stretch: Stretch, effects: Effects, rng: Generator) -> None:
    """Tilt the ground and add noise to the points. Their slices stay what they are."""
    grade, cross = rng.uniform(-effects.tilt, effects.tilt, 2)
    middle = (len(stretch.center) - 1) / 2.0
    x, y = stretch.xyz[:, 0] + stretch.number - middle, stretch.xyz[:, 1]
    noise = rng.uniform(0.0, effects.jitter) * rng.standard_normal(stretch.xyz.shape)
    stretch.xyz = stretch.xyz + noise
    stretch.xyz[:, 2] += grade * x + cross * y
    stretch.corridor = stretch.corridor.copy()
    stretch.corridor[:, HEIGHT] += grade * (np.arange(len(stretch.center)) - middle) + cross * stretch.center


def relight(stretch: Stretch, effects: Effects, rng: Generator) -> None:
    """Change intensities and colours as another scanner, other materials and another camera would have."""
    if rng.random() >= effects.plain and stretch.intensity.any():
        _relight_intensities(stretch, effects, rng)
    if rng.random() < effects.colorless:
        stretch.has_color = False
    elif stretch.has_color:
        factors = np.exp(effects.tint * (rng.uniform(-1.0, 1.0) + rng.uniform(-1.0, 1.0, 3)))
        stretch.rgb = np.clip(stretch.rgb * factors, 0.0, 1.0)


def _relight_intensities(stretch: Stretch, effects: Effects, rng: Generator) -> None:
    share = rng.random(7)
    value, marked = _repainted(np.maximum(stretch.intensity, 0.0), stretch, effects.repaint, rng)
    value = _worn(value, stretch.paved, marked, effects.paint * share[0])
    value = np.where(stretch.paved, value, value * np.exp(effects.contrast * rng.uniform(-1.0, 1.0)))
    value = _blurred(value, stretch, effects.footprint * share[5])
    value *= _falloff(stretch.xyz[:, 1], effects.falloff * share[1], rng)
    low, high = np.log(effects.gamma)
    log = np.exp(low + share[4] * (high - low)) * np.log(np.maximum(value / np.max(value), _DARKEST))
    # Noise by the spread, so that a scanner that compresses its intensities isn't drowned in it.
    spread = float(np.subtract(*np.percentile(log, (90.0, 10.0))))
    noise = effects.speckle * share[2] * rng.standard_normal(len(value))
    pattern = effects.patches * share[3] * _waves(stretch, rng) + effects.stripes * share[6] * _tracks(stretch, rng)
    stretch.intensity = np.exp(log + spread * (noise + pattern))


def _repainted(value: Float, stretch: Stretch, probability: float, rng: Generator) -> tuple[Float, NDArray[np.bool_]]:
    """Return intensities and what is marked (K,) where the lines of a carriageway without shoulders are others.

    Two lanes are parted by dashes on motorways; on rural roads as well by a solid or a double line, or by none; and
    many of them have no edge lines. On a motorway that would lead astray: beside a ramp it is by its dashes that the
    line between the lanes is known.
    """
    lane, edge, side, width = rng.random(4)
    marked, bare = stretch.marked, stretch.paved & ~stretch.marked
    if not _without_shoulders(stretch) or not marked.any() or not bare.any():
        return value, marked
    paint, pavement = float(np.median(value[marked])), float(np.median(value[bare]))
    y = stretch.xyz[:, 1] - stretch.center[stretch.number]
    edges = stretch.lines[stretch.number] * [1.0, -1.0]
    gone = np.zeros(len(value), dtype=bool)
    both, one = edge < probability, probability <= edge < 2.0 * probability
    worn = (both or (one and side < 0.5), both or (one and side >= 0.5), lane >= 1.0 - probability)
    for happens, offset in zip(worn, (edges[:, 0], edges[:, 1], 0.0), strict=True):
        if happens:
            gone |= marked & (np.abs(y - offset) < _LINE_REACH)
    if lane < probability:
        low, high = _LINE_WIDTHS
        painted = stretch.paved & (np.abs(y) < 0.5 * (low + (high - low) * width))
        value, marked = np.where(painted, paint, value), marked | painted
    return np.where(gone, pavement, value), marked & ~gone


def _without_shoulders(stretch: Stretch) -> bool:
    """Return whether the pavement ends near the edge lines on both sides of a carriageway, as on rural roads."""
    if not np.isfinite(stretch.room).any():
        return False
    edges = np.column_stack([stretch.corridor[:, LEFT] - stretch.center, stretch.center - stretch.corridor[:, RIGHT]])
    beyond = (edges - stretch.lines)[np.isfinite(edges) & np.isfinite(stretch.lines)]
    return bool(len(beyond)) and float(beyond.max()) <= _NO_SHOULDER


def _worn(value: Float, paved: NDArray[np.bool_], marked: NDArray[np.bool_], share: float) -> Float:
    """Return intensities whose markings have lost a share of what they are brighter than the pavement."""
    bare = paved & ~marked
    if not marked.any() or not bare.any():
        return value
    pavement = float(np.median(value[bare]))
    return np.where(marked, value + share * np.minimum(pavement - value, 0.0), value)


def _blurred(value: Float, stretch: Stretch, width: float) -> Float:
    """Return the means of intensities (K,) over a beam's footprint: over points of the slice within half a width in y.

    A line seen by a wide beam is wider and fainter than it is.
    """
    if not len(value) or width < _NARROWEST:
        return value
    y = stretch.xyz[:, 1] - stretch.xyz[:, 1].min()
    # Slices far apart from each other on one axis, so that one search finds all windows.
    place = stretch.number * (2.0 * (float(y.max()) + width)) + y
    order = np.argsort(place)
    place = place[order]
    total = np.concatenate([[0.0], np.cumsum(value[order])])
    first = np.searchsorted(place, place - 0.5 * width, side="left")
    last = np.searchsorted(place, place + 0.5 * width, side="right")
    result = np.empty_like(value)
    result[order] = (total[last] - total[first]) / (last - first)
    return result


def _falloff(y: Float, power: float, rng: Generator) -> Float:
    """Return factors (K,) of intensities that fall off with the range from one or two scanners above the road.

    Heights go from a vehicle's to an aircraft's, equally in logarithms. Of two passes beside each other a point belongs
    to either, the likelier the nearer: seen from near it is bright, and from far dark, in the same place.
    """
    passes = int(rng.integers(1, 3))
    height = np.exp(rng.uniform(*np.log(_SCANNER_HEIGHTS)))
    square = height**2 + (y[:, None] - rng.uniform(-_SCANNER_ASIDE, _SCANNER_ASIDE, passes)) ** 2
    nearness = np.cumsum(1.0 / square, axis=1)
    chosen = (rng.random(len(y))[:, None] * nearness[:, -1:] > nearness).sum(axis=1)
    result: Float = (square[np.arange(len(y)), chosen] / height**2) ** (-power / 2.0)
    return result


def _tracks(stretch: Stretch, rng: Generator) -> Float:
    """Return a random function (K,) of about unit deviation that only changes across the road: waves of 0.7 to 6 m."""
    count = 5
    rate = 2.0 * np.pi / np.exp(rng.uniform(np.log(0.7), np.log(6.0), count))
    y = stretch.xyz[:, 1] - np.nan_to_num(stretch.center)[stretch.number]
    angle = y[:, None] * rate + rng.uniform(0.0, 2.0 * np.pi, count)
    result: Float = np.cos(angle).sum(axis=1) * np.sqrt(2.0 / count)
    return result


def _waves(stretch: Stretch, rng: Generator) -> Float:
    """Return a smooth random function of the place (K,) of about unit deviation: waves of 2 to 20 m any way."""
    count = 6
    rate = 2.0 * np.pi / np.exp(rng.uniform(np.log(2.0), np.log(20.0), count))
    way, phase = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    x, y = stretch.xyz[:, 0] + stretch.number, stretch.xyz[:, 1]
    angle = x[:, None] * (rate * np.cos(way)) + y[:, None] * (rate * np.sin(way)) + phase
    result: Float = np.cos(angle).sum(axis=1) * np.sqrt(2.0 / count)
    return result
