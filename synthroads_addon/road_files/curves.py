"""Curves that files know and alignments don't: transition curves other than clothoids, and cubics in the plane.

They become chains of elements of linear curvature, each with the curve's own heading at both of its ends, as many as
keep within a tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..base.arrays import Float
from ..road.alignment import Alignment, Element

TOLERANCE = 2e-4
"""Distance (m) that a chain of elements may keep from the curve that it stands for."""
_MOST_PIECES = 512
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_SPACING = 0.5
"""Longest step (m) of an integration by Gauss and Legendre's rule with five points."""
_STEPS = 4096
"""Most steps of such an integration along one curve."""
_LENGTH_ERROR = 1e-10
"""Relative error of a cubic's end, by its arc length. Chosen."""


@dataclass(frozen=True)
class Curve:
    """A curve by its arc length.

    Attributes:
        length: m.
        heading: of stations (N,), m, the heading less that at the start, rad.
        curvature: of stations (N,), m, the curvature, 1/m, positive to the left.
    """

    length: float
    heading: Callable[[Float], Float]
    curvature: Callable[[Float], Float]

    def positions(self, station: Float) -> Float:
        """Return positions (N, 2), m, of stations (N,), as seen from the start along its tangent."""
        count = int(np.clip(np.ceil(self.length / _SPACING), 1, _STEPS))
        knots = np.linspace(0.0, self.length, count + 1)
        at = np.clip(np.searchsorted(knots, station, "right") - 1, 0, count - 1)
        before = np.concatenate([[0.0], np.cumsum(self._chords(knots[:-1], knots[1:]))])
        place = before[at] + self._chords(knots[at], station)
        return np.column_stack([place.real, place.imag])

    def _chords(self, first: Float, last: Float) -> np.ndarray:
        """Return the complex vectors (N,) between stations (N,): the integrals of exp(i heading)."""
        half, middle = 0.5 * (last - first), 0.5 * (last + first)
        inner = middle[:, None] + half[:, None] * _NODES
        return half * (np.exp(1j * self.heading(inner.ravel()).reshape(inner.shape)) @ _WEIGHTS)


def _clothoid(u: Float) -> tuple[Float, Float]:
    return u, 0.5 * u**2


def _bloss(u: Float) -> tuple[Float, Float]:
    return u**2 * (3.0 - 2.0 * u), u**3 - 0.5 * u**4


def _cosine(u: Float) -> tuple[Float, Float]:
    return 0.5 * (1.0 - np.cos(np.pi * u)), 0.5 * u - np.sin(np.pi * u) / (2.0 * np.pi)


def _sine(u: Float) -> tuple[Float, Float]:
    turn = 2.0 * np.pi * u
    return u - np.sin(turn) / (2.0 * np.pi), 0.5 * u**2 + (np.cos(turn) - 1.0) / (2.0 * np.pi) ** 2


def _helmert(u: Float) -> tuple[Float, Float]:
    rest = 1.0 - u
    first = u <= 0.5
    return np.where(first, 2.0 * u**2, 1.0 - 2.0 * rest**2), np.where(
        first, 2.0 * u**3 / 3.0, u - 0.5 + 2.0 * rest**3 / 3.0
    )


TRANSITIONS: dict[str, Callable[[Float], tuple[Float, Float]]] = {
    "clothoid": _clothoid,
    "bloss": _bloss,
    "cosine": _cosine,
    "sine": _sine,
    "helmert": _helmert,
}
"""Share of a transition's change of curvature, and that share's integral, at a share u of its length, by its name.

Clothoid: u. Bloss: 3 u^2 - 2 u^3. Cosine: (1 - cos pi u) / 2. Sine (Klein): u - sin(2 pi u) / (2 pi). Helmert or
biquadratic (Schramm): 2 u^2 in the first half, 1 - 2 (1 - u)^2 in the second. As IfcAlignmentHorizontalSegmentTypeEnum
(IFC 4.3) and spiType (LandXML 1.2) name them.
"""


def transition(kind: str, length: float, first: float, last: float) -> Curve:
    """Return a transition curve of a kind (`TRANSITIONS`) and length (m) between two curvatures (1/m)."""
    shape = TRANSITIONS[kind]

    def heading(station: Float) -> Float:
        return first * station + (last - first) * length * shape(station / length)[1]

    def curvature(station: Float) -> Float:
        return first + (last - first) * shape(station / length)[0]

    return Curve(length, heading, curvature)


def cubic_curve(u: Float, v: Float, last: float) -> tuple[Curve, float, Float]:
    """Return the plane curve of two cubics of a parameter, its heading at the start (rad), and its start (2,), m.

    Args:
        u, v: (4,) coefficients of the parameter's powers 0 to 3, of the coordinates along and across.
        last: the parameter's value at the end; it begins with 0.

    Raises:
        ValueError: the curve stands still somewhere.
    """
    along, across = (np.polynomial.Polynomial(np.asarray(each, dtype=np.float64)) for each in (u, v))
    d_along, d_across = along.deriv(), across.deriv()
    dd_along, dd_across = d_along.deriv(), d_across.deriv()

    def speed(p: Float) -> Float:
        return np.hypot(d_along(p), d_across(p))

    rough = abs(last) * float(speed(np.linspace(0.0, last, 65)).max())
    if not (np.isfinite(rough) and rough > 0.0):
        raise ValueError("this one has no length")
    count = int(np.clip(np.ceil(rough / _SPACING), 16, _STEPS))
    knots = np.linspace(0.0, last, count + 1)
    half = 0.5 * np.diff(knots)
    inner = (knots[:-1] + half)[:, None] + half[:, None] * _NODES
    if not (speed(np.concatenate([knots, inner.ravel()])) > 1e-9 * rough / abs(last)).all():
        raise ValueError("this one doesn't move on everywhere")
    run = np.concatenate([[0.0], np.cumsum(half * (speed(inner) @ _WEIGHTS))])
    angle = np.unwrap(np.arctan2(d_across(knots), d_along(knots)))

    def parameter(station: Float) -> Float:
        """Return the parameter of stations: by the table, then by two of Newton's steps."""
        p = np.interp(station, run, knots)
        for _ in range(2):
            at = np.clip(np.searchsorted(knots, p, "right") - 1, 0, count - 1)
            width = 0.5 * (p - knots[at])
            nodes = (knots[at] + width)[:, None] + width[:, None] * _NODES
            p = np.clip(p - (run[at] + width * (speed(nodes) @ _WEIGHTS) - station) / speed(p), 0.0, last)
        return p

    def heading(station: Float) -> Float:
        p = parameter(station)
        exact = np.arctan2(d_across(p), d_along(p))
        near = np.interp(p, knots, angle)
        return exact + 2.0 * np.pi * np.round((near - exact) / (2.0 * np.pi)) - angle[0]

    def curvature(station: Float) -> Float:
        p = parameter(station)
        return (d_along(p) * dd_across(p) - d_across(p) * dd_along(p)) / speed(p) ** 3

    start = np.array([along(0.0), across(0.0)])
    return Curve(float(run[-1]), heading, curvature), float(angle[0]), start


def cubic_up_to(v: Float, length: float) -> tuple[Curve, float, Float]:
    """Return the curve whose offset is a cubic (4,) of the distance along the tangent, up to an arc length (m).

    It is OpenDRIVE's `poly3`, whose u isn't the station: see `cubic_curve` for what is returned, and raised.
    """
    u = np.array([0.0, 1.0, 0.0, 0.0])  # the parameter itself is the distance along the tangent

    def excess(last_u: float) -> float:
        """Return how much longer than wanted the curve is that ends at this distance along the tangent, m."""
        return cubic_curve(u, v, last_u)[0].length - length

    # The arc length int sqrt(1 + v'(u)^2) du grows with its end. The end lies between that of a curve that is as steep
    # everywhere as this one anywhere, and the length itself, which only a straight line reaches.
    slope = np.polynomial.Polynomial(v).deriv()
    extremes = slope.deriv().roots()
    inner = extremes.real[(np.abs(extremes.imag) < 1e-12) & (extremes.real > 0.0) & (extremes.real < length)]
    steepest = float(np.abs(slope(np.array([0.0, length, *inner]))).max())
    least_u = length / np.hypot(1.0, steepest)
    if steepest < 1e-9 or excess(length) <= 0.0:
        return cubic_curve(u, v, length)
    last_u = brentq(excess, least_u * (1.0 - 1e-6), length, xtol=_LENGTH_ERROR * length, rtol=1e-12)
    return cubic_curve(u, v, float(last_u))


def as_elements(curve: Curve, tolerance: float = TOLERANCE) -> tuple[list[Element], float]:
    """Return elements of linear curvature that follow a curve, and their largest distance from it, m.

    Each has the curve's headings at its ends and its difference of curvature; their number is doubled until they keep
    within the tolerance (m).
    """
    station = np.linspace(0.0, curve.length, int(np.clip(curve.length, 16, 2048)) + 1)
    positions = curve.positions(station)
    count = 1
    while True:
        knots = np.linspace(0.0, curve.length, count + 1)
        step = curve.length / count
        mean = np.diff(curve.heading(knots)) / step
        half = 0.5 * np.diff(curve.curvature(knots))
        elements = [Element(step, m - h, m + h) for m, h in zip(mean.tolist(), half.tolist(), strict=True)]
        worst = float(np.hypot(*(Alignment(elements).position(station) - positions).T).max())
        if worst <= tolerance or 2 * count > _MOST_PIECES:
            return elements, worst
        count *= 2
