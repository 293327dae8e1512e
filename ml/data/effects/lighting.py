"""Effects on the intensities and colours of a sequence: other scanners, materials, markings and cameras."""

import numpy as np

from synthroads_addon.base.arrays import Bool, Float

from ...registry import effect
from ..samples import Stretch
from .slices import SequenceEffects

Generator = np.random.Generator

_DARKEST = 1e-5
"""Share of the brightest intensity to which smaller ones are raised."""
_NARROWEST = 0.02
"""Width of a footprint below which it has no effect, m."""
_LINE_REACH = 0.5
"""Distance from a line's place within which paint belongs to the line, m."""
_LINE_WIDTHS = (0.12, 0.6)
"""Least and largest width of a solid lane line, m: one narrow line, and a double one with the gap."""
_VERGE_TONE = 0.3
"""Logarithm of the largest factor by which a verge of crushed stone is brighter or darker than asphalt."""
_SCANNER_HEIGHTS = (1.5, 60.0)
_SCANNER_ASIDE = 15.0
"""Largest distance of a scanner from the path, m; the heights are the lowest and the highest of scanners."""


@effect("centerline", order=40)
def change_intensities(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Change the sequence's intensities at random, in place, as another scanner, materials and markings would."""
    if rng.random() < effects.plain or not stretch.strength.any():
        return
    share = rng.random(7)
    value, is_marking = _repaint_lines(np.maximum(stretch.strength, 0.0), stretch, effects.repaint, rng)
    value = _wear_markings(value, stretch.paved, is_marking, effects.paint * share[0])
    value, like_pavement = _verges(value, stretch, is_marking, effects.verge, rng)
    value = np.where(like_pavement, value, value * np.exp(effects.contrast * rng.uniform(-1.0, 1.0)))
    value = _blur_footprint(value, stretch, effects.footprint * share[5])
    value *= _falloff(stretch.coord[:, 1], effects.falloff * share[1], rng)
    log_least, log_largest = np.log(effects.gamma)
    log = np.exp(log_least + share[4] * (log_largest - log_least)) * np.log(np.maximum(value / np.max(value), _DARKEST))
    # Noise by the spread, so that a scanner that compresses its intensities isn't drowned in it.
    spread = float(np.subtract(*np.percentile(log, (90.0, 10.0))))
    noise = effects.speckle * share[2] * rng.standard_normal(len(value))
    pattern = effects.patches * share[3] * _waves(stretch, rng) + effects.stripes * share[6] * _tracks(stretch, rng)
    stretch.strength = np.exp(log + spread * (noise + pattern))


@effect("centerline", order=60)
def tint_colors(stretch: Stretch, effects: SequenceEffects, rng: Generator) -> None:
    """Multiply the sequence's colours by random factors per channel, in place, as another camera would."""
    if stretch.color is not None:
        factors = np.exp(effects.tint * (rng.uniform(-1.0, 1.0) + rng.uniform(-1.0, 1.0, 3)))
        stretch.color = np.clip(stretch.color * factors, 0.0, 1.0)


def _repaint_lines(value: Float, stretch: Stretch, probability: float, rng: Generator) -> tuple[Float, Bool]:
    """Return intensities and marking mask (K,) with lane and edge lines of a rural carriageway repainted or worn off.

    Two lanes are separated by dashes on motorways; on rural roads also by a solid or a double line, or by none; and
    many of them have no edge lines. Motorways stay as they are: beside a ramp it is by its dashes that the
    line between the lanes is known.
    """
    lane, edge, side, width = rng.random(4)
    is_marking, is_bare = stretch.marked, stretch.paved & ~stretch.marked
    if not stretch.without_shoulders() or not is_marking.any() or not is_bare.any():
        return value, is_marking
    paint, pavement = float(np.median(value[is_marking])), float(np.median(value[is_bare]))
    y = stretch.coord[:, 1] - stretch.center[stretch.number]
    edges = stretch.lines[stretch.number] * [1.0, -1.0]
    is_worn = np.zeros(len(value), dtype=bool)
    both_worn, one_worn = edge < probability, probability <= edge < 2.0 * probability
    line_is_worn = (
        both_worn or (one_worn and side < 0.5),
        both_worn or (one_worn and side >= 0.5),
        lane >= 1.0 - probability,
    )
    for happens, offset in zip(line_is_worn, (edges[:, 0], edges[:, 1], 0.0), strict=True):
        if happens:
            is_worn |= is_marking & (np.abs(y - offset) < _LINE_REACH)
    if lane < probability:
        narrowest, widest = _LINE_WIDTHS
        in_line = stretch.paved & (np.abs(y) < 0.5 * (narrowest + (widest - narrowest) * width))
        value, is_marking = np.where(in_line, paint, value), is_marking | in_line
    return np.where(is_worn, pavement, value), is_marking & ~is_worn


def _verges(value: Float, stretch: Stretch, is_marking: Bool, widest: float, rng: Generator) -> tuple[Float, Bool]:
    """Return intensities (K,) with crushed-stone verges added to a rural road, and a mask (K,) of what looks paved.

    The verges are hardly brighter or darker than asphalt, so that the pavement seems wider than it is.
    """
    widths, tone = rng.uniform(0.0, widest, 2), np.exp(_VERGE_TONE * rng.uniform(-1.0, 1.0))
    is_bare = stretch.paved & ~is_marking
    if not stretch.without_shoulders() or not is_bare.any():
        return value, stretch.paved
    y = stretch.coord[:, 1] - stretch.center[stretch.number]
    excess = np.column_stack([y, -y]) - stretch.paved_sides()[stretch.number]
    verge = ~stretch.paved & ((excess > 0.0) & (excess < widths)).any(axis=1)
    verge_level = float(np.median(value[verge])) if verge.any() else 0.0
    if verge_level <= 0.0:
        return value, stretch.paved
    return np.where(
        verge, value * (tone * float(np.median(value[is_bare])) / verge_level), value
    ), stretch.paved | verge


def _wear_markings(value: Float, is_paved: Bool, is_marking: Bool, share: float) -> Float:
    """Return intensities (K,) with the markings' excess over the pavement's median reduced by a share."""
    is_bare = is_paved & ~is_marking
    if not is_marking.any() or not is_bare.any():
        return value
    pavement = float(np.median(value[is_bare]))
    return np.where(is_marking, value + share * np.minimum(pavement - value, 0.0), value)


def _blur_footprint(value: Float, stretch: Stretch, width: float) -> Float:
    """Return intensities (K,) averaged over a beam's footprint: the slice's points within `width` / 2 (m) in y.

    A line seen by a wide beam is wider and fainter than it is.
    """
    if not len(value) or width < _NARROWEST:
        return value
    y = stretch.coord[:, 1] - stretch.coord[:, 1].min()
    # Slices far apart from each other on one axis, so that one search finds all windows.
    position = stretch.number * (2.0 * (float(y.max()) + width)) + y
    order = np.argsort(position)
    position = position[order]
    total = np.concatenate([[0.0], np.cumsum(value[order])])
    begin = np.searchsorted(position, position - 0.5 * width, side="left")
    end = np.searchsorted(position, position + 0.5 * width, side="right")
    result = np.empty_like(value)
    result[order] = (total[end] - total[begin]) / (end - begin)
    return result


def _falloff(y: Float, power: float, rng: Generator) -> Float:
    """Return factors (K,) for intensities that fall with range^`power` from one or two random scanners above the road.

    Heights go from a vehicle's to an aircraft's, equally in logarithms. Of two passes beside each other a point belongs
    to either, the likelier the nearer: seen from near it is bright, and from far dark, in the same place.
    """
    passes = int(rng.integers(1, 3))
    height = np.exp(rng.uniform(*np.log(_SCANNER_HEIGHTS)))
    square = height**2 + (y[:, None] - rng.uniform(-_SCANNER_ASIDE, _SCANNER_ASIDE, passes)) ** 2
    nearness = np.cumsum(1.0 / square, axis=1)
    scanner = (rng.random(len(y))[:, None] * nearness[:, -1:] > nearness).sum(axis=1)
    result: Float = (square[np.arange(len(y)), scanner] / height**2) ** (-power / 2.0)
    return result


def _tracks(stretch: Stretch, rng: Generator) -> Float:
    """Return random values (K,) of about unit deviation that vary across the road only: waves of 1.5 to 6 m."""
    # Chosen: five waves look irregular.
    count = 5
    rate = 2.0 * np.pi / np.exp(rng.uniform(np.log(1.5), np.log(6.0), count))
    y = stretch.coord[:, 1] - np.nan_to_num(stretch.center)[stretch.number]
    angle = y[:, None] * rate + rng.uniform(0.0, 2.0 * np.pi, count)
    result: Float = np.cos(angle).sum(axis=1) * np.sqrt(2.0 / count)
    return result


def _waves(stretch: Stretch, rng: Generator) -> Float:
    """Return random values (K,) of about unit deviation, smooth over the ground: waves of 2 to 20 m any way."""
    # Chosen: six waves look irregular.
    count = 6
    rate = 2.0 * np.pi / np.exp(rng.uniform(np.log(2.0), np.log(20.0), count))
    wave_direction, phase = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    x, y = stretch.points_along(), stretch.coord[:, 1]
    angle = x[:, None] * (rate * np.cos(wave_direction)) + y[:, None] * (rate * np.sin(wave_direction)) + phase
    result: Float = np.cos(angle).sum(axis=1) * np.sqrt(2.0 / count)
    return result
