"""Patches and cracks of a carriageway from a seed, by the densities that a scenario allows.

Shapes follow the catalogue of distresses of road surveys (ZTV ZEB-StB; SHRP-P-338, Distress Identification Manual):
longitudinal cracks along wheel tracks and joints, transverse ones across one lane or more, alligator cracks as nets of
cells of 0.1 to 0.3 m in the wheel tracks; sealed by bands of bitumen about 5 cm wide; patches along the lane.
"""

import math

import numpy as np

from ..base.random_streams import stream
from ..base.schema import round_value
from ..road.objects import Side
from ..road.section import Corner, Crack, Patch
from ..scenario.road import MaterialLimits
from .placing.draw import draw, draw_between

_LONG_PER_KM, _ACROSS_PER_KM, _NETS_PER_KM = 25.0, 80.0, 10.0
CRACKS_PER_KM = _LONG_PER_KM + _ACROSS_PER_KM + _NETS_PER_KM
"""Cracks in a km of carriageway that is cracked all over."""
_LENGTH = {"long": (4.0, 25.0), "net": (1.0, 4.0), "patch": (1.5, 12.0)}
_GAP, _BAND = (0.003, 0.012), (0.04, 0.06)
"""Widths of open cracks and of sealing bands, m."""
_GAP_DEPTH, _BAND_DEPTH = (0.004, 0.03), (-0.002, 0.001)
"""Depths of open cracks, which are filled with dirt below, and of bands, which mostly stand out, m."""
_PATCH_HEIGHT = (-0.004, 0.004)
"""Heights of patches above the pavement, m."""
_TRACK = 0.9
"""Distance of a wheel track from the lane's middle, m."""
_STEP, _CELL = 0.6, 0.2
"""Distance of a crack's corners along it, and size of an alligator's cells, m."""


def draw_materials(limits: MaterialLimits, seed: int) -> dict[str, float]:
    """Return a value drawn within each of the limits, by name."""
    rng = stream(seed, "materials")
    return {name: draw(rng, getattr(limits, name)) for name in MaterialLimits.model_fields}


class PavementDamage:
    """Draws the patches and cracks of a carriageway.

    Args:
        limits: of materials.
        seed: of the road.
        side: of the carriageway.
        length: of the road, m.
        edges: distances (m) of the lanes' boundaries from the centreline, outermost first.
    """

    def __init__(self, limits: MaterialLimits, seed: int, side: Side, length: float, edges: tuple[float, ...]) -> None:
        densities = draw_materials(limits, seed)
        self._patch_density, self._crack_density = densities["patch_density"], densities["crack_density"]
        self._seed, self._side, self._length, self._edges = seed, side, length, edges
        self._depths = stream(seed, "crack depths", side)
        self._sign = 1.0 if side == "left" else -1.0

    def patches(self) -> tuple[Patch, ...]:
        """Return drawn patches along lanes, each as wide as the lane or one of its halves."""
        rng, heights = (stream(self._seed, purpose, self._side) for purpose in ("patches", "patch heights"))
        result = []
        for _ in range(_count(self._patch_density * self._length / 100.0, rng)):
            outer, inner = self._lane(rng)
            middle = (outer + inner) / 2.0
            inner_edge, outer_edge = [(inner, outer), (inner, middle), (middle, outer)][rng.integers(3)]
            inner_edge, outer_edge = inner_edge + 0.15, outer_edge - 0.15  # beside the markings
            start, end = self._stretch(_LENGTH["patch"], rng)
            corners = [(start, inner_edge), (end, inner_edge), (end, outer_edge), (start, outer_edge)]
            age, height = draw_between(rng, (0.0, 1.0)), draw_between(heights, _PATCH_HEIGHT)
            result.append(Patch(outline=tuple(map(self._corner, corners)), age=age, height=height))
        return tuple(result)

    def cracks(self) -> tuple[Crack, ...]:
        """Return drawn cracks: longitudinal, then transverse, then alligator ones."""
        rng = stream(self._seed, "cracks", self._side)
        share = self._crack_density * self._length / 1000.0
        result = [self._along(rng) for _ in range(_count(_LONG_PER_KM * share, rng))]
        result += [self._across(rng) for _ in range(_count(_ACROSS_PER_KM * share, rng))]
        return (*result, *(self._net(rng) for _ in range(_count(_NETS_PER_KM * share, rng))))

    def _along(self, rng: np.random.Generator) -> Crack:
        """Return a drawn longitudinal crack in a wheel track or at a lane's outer joint."""
        outer, inner = self._lane(rng)
        middle = (outer + inner) / 2.0
        crack_distance = [middle - _TRACK, middle + _TRACK, outer - 0.13][rng.integers(3)]
        start, end = self._stretch(_LENGTH["long"], rng)
        stations = np.linspace(start, end, 2 + int((end - start) / _STEP))
        deviation = _wander(len(stations), 0.03, rng)
        return self._crack(
            "longitudinal", [np.column_stack([stations, crack_distance + deviation])], rng, sealed_share=0.6
        )

    def _across(self, rng: np.random.Generator) -> Crack:
        """Return a drawn transverse crack over one or more lanes."""
        first_edge = int(rng.integers(len(self._edges) - 1))
        last_edge = int(rng.integers(first_edge + 1, len(self._edges)))
        outer, inner = self._edges[first_edge], self._edges[last_edge]
        distances = np.linspace(inner, outer, 2 + int((outer - inner) / _STEP))
        deviation = _wander(len(distances), 0.06, rng)
        middle = draw_between(rng, (1.0, max(1.0, self._length - 1.0)))
        stations = np.clip(middle + deviation - deviation.mean(), 0.0, self._length)
        return self._crack("transverse", [np.column_stack([stations, distances])], rng, sealed_share=0.7)

    def _net(self, rng: np.random.Generator) -> Crack:
        """Return an alligator crack: rows and columns of a grid whose nodes were moved."""
        outer, inner = self._lane(rng)
        track = (outer + inner) / 2.0 + _TRACK * (1.0 if rng.random() < 0.5 else -1.0)
        start, end = self._stretch(_LENGTH["net"], rng)
        rows, columns = 2 + int((end - start) / _CELL), 4
        stations, distances = np.meshgrid(np.linspace(start, end, rows), track + _CELL * (np.arange(columns) - 1.5))
        grid = np.stack([stations, distances], axis=-1).swapaxes(0, 1)
        grid = grid + rng.uniform(-0.35, 0.35, grid.shape) * _CELL
        grid[..., 0] = np.clip(grid[..., 0], 0.0, self._length)
        lines = [*grid, *grid.swapaxes(0, 1)]
        return self._crack("alligator", lines, rng, sealed_share=0.0)

    def _crack(self, kind: str, lines: list[np.ndarray], rng: np.random.Generator, sealed_share: float) -> Crack:
        """Return a crack along lines of (station, distance), m, of a drawn width and depth, perhaps sealed."""
        is_sealed = bool(rng.random() < sealed_share)
        corners = tuple(tuple(self._corner((float(s), float(d))) for s, d in line) for line in lines)
        width = draw_between(rng, _BAND if is_sealed else _GAP)
        depth = draw_between(self._depths, _BAND_DEPTH if is_sealed else _GAP_DEPTH)
        return Crack(kind=kind, width=width, sealed=is_sealed, depth=depth, lines=corners)

    def _lane(self, rng: np.random.Generator) -> tuple[float, float]:
        """Return the distances (m) of outer and inner edge of a drawn lane, mostly an outer one: of heavy vehicles."""
        lanes = len(self._edges) - 1
        number = min(int(lanes * rng.random() ** 1.5), lanes - 1)
        return self._edges[number], self._edges[number + 1]

    def _stretch(self, lengths: tuple[float, float], rng: np.random.Generator) -> tuple[float, float]:
        """Return the stations (m) of a drawn stretch with a length within limits (m), somewhere on the road."""
        length = min(draw_between(rng, lengths), self._length)
        start = (self._length - length) * rng.random()
        return start, start + length

    def _corner(self, place: tuple[float, float]) -> Corner:
        """Return the station and offset (m), rounded, of a place given as station and distance from the centreline."""
        return round_value(min(place[0], self._length)), round_value(self._sign * place[1])


def _count(expected: float, rng: np.random.Generator) -> int:
    """Return a whole number whose mean is the expected number: the fraction decides the chance of one more."""
    return math.floor(expected + rng.random()) if expected > 0.0 else 0


def _wander(count: int, amplitude: float, rng: np.random.Generator) -> np.ndarray:
    """Return a random walk (count,), m, of normal steps of a standard deviation (m), which comes back to 0."""
    walk = np.cumsum(rng.normal(0.0, amplitude, count))
    return np.asarray(walk - np.linspace(walk[0], walk[-1], count))
