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
        step = np.clip(np.searchsorted(knots, station, "right") - 1, 0, count - 1)
        knot_places = np.concatenate([[0.0], np.cumsum(self._chords(knots[:-1], knots[1:]))])
        places = knot_places[step] + self._chords(knots[step], station)
        return np.column_stack([places.real, places.imag])

    def _chords(self, start: Float, end: Float) -> np.ndarray:
        """Return the vectors (N,) between stations (N,), m, as x + iy: Gauss' rule for exp(i heading)."""
        half, middle = 0.5 * (end - start), 0.5 * (end + start)
        nodes = middle[:, None] + half[:, None] * _NODES
        return half * (np.exp(1j * self.heading(nodes.ravel()).reshape(nodes.shape)) @ _WEIGHTS)


def _clothoid(u: Float) -> tuple[Float, Float]:
    """Return curvature share and integral (`TRANSITIONS`) of a clothoid: u."""
    return u, 0.5 * u**2


def _bloss(u: Float) -> tuple[Float, Float]:
    """Return curvature share and integral (`TRANSITIONS`) of a Bloss curve: 3 u^2 - 2 u^3."""
    return u**2 * (3.0 - 2.0 * u), u**3 - 0.5 * u**4


def _cosine(u: Float) -> tuple[Float, Float]:
    """Return curvature share and integral (`TRANSITIONS`) of a cosine curve: (1 - cos pi u) / 2."""
    return 0.5 * (1.0 - np.cos(np.pi * u)), 0.5 * u - np.sin(np.pi * u) / (2.0 * np.pi)


def _sine(u: Float) -> tuple[Float, Float]:
    """Return curvature share and integral (`TRANSITIONS`) of a sine curve (Klein): u - sin(2 pi u) / (2 pi)."""
    turn = 2.0 * np.pi * u
    return u - np.sin(turn) / (2.0 * np.pi), 0.5 * u**2 + (np.cos(turn) - 1.0) / (2.0 * np.pi) ** 2


def _helmert(u: Float) -> tuple[Float, Float]:
    """Return curvature share and integral (`TRANSITIONS`) of a Helmert curve (Schramm): 2 u^2, then 1 - 2 (1 - u)^2."""
    remainder = 1.0 - u
    in_first_half = u <= 0.5
    return np.where(in_first_half, 2.0 * u**2, 1.0 - 2.0 * remainder**2), np.where(
        in_first_half, 2.0 * u**3 / 3.0, u - 0.5 + 2.0 * remainder**3 / 3.0
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


def transition(kind: str, length: float, start_curvature: float, end_curvature: float) -> Curve:
    """Return a transition curve of a kind (`TRANSITIONS`) and length (m) from a start to an end curvature (1/m)."""
    shape = TRANSITIONS[kind]

    # k(s) = k1 + (k2 - k1) f(s / L); its integral is the heading.
    def heading(station: Float) -> Float:
        return start_curvature * station + (end_curvature - start_curvature) * length * shape(station / length)[1]

    def curvature(station: Float) -> Float:
        return start_curvature + (end_curvature - start_curvature) * shape(station / length)[0]

    return Curve(length, heading, curvature)


def cubic_curve(u: Float, v: Float, end: float) -> tuple[Curve, float, Float]:
    """Return the plane curve of two cubics of one parameter, its heading at the start (rad), and its start (2,), m.

    Args:
        u, v: (4,) coefficients of the parameter's powers 0 to 3, of the coordinates along and across.
        end: the parameter's value at the end of the curve; at its start it is 0.

    Raises:
        ValueError: the curve stands still somewhere.
    """
    u_cubic, v_cubic = (np.polynomial.Polynomial(np.asarray(each, dtype=np.float64)) for each in (u, v))
    du, dv = u_cubic.deriv(), v_cubic.deriv()
    ddu, ddv = du.deriv(), dv.deriv()

    def speed(p: Float) -> Float:
        return np.hypot(du(p), dv(p))

    rough_length = abs(end) * float(speed(np.linspace(0.0, end, 65)).max())
    if not (np.isfinite(rough_length) and rough_length > 0.0):
        raise ValueError("this cubic has no length")
    count = int(np.clip(np.ceil(rough_length / _SPACING), 16, _STEPS))
    knots = np.linspace(0.0, end, count + 1)
    half = 0.5 * np.diff(knots)
    gauss_nodes = (knots[:-1] + half)[:, None] + half[:, None] * _NODES
    if not (speed(np.concatenate([knots, gauss_nodes.ravel()])) > 1e-9 * rough_length / abs(end)).all():
        raise ValueError("the speed of this cubic is 0 at a place: it stands still there")
    knot_stations = np.concatenate([[0.0], np.cumsum(half * (speed(gauss_nodes) @ _WEIGHTS))])
    knot_headings = np.unwrap(np.arctan2(dv(knots), du(knots)))

    def parameter(station: Float) -> Float:
        """Return the parameter of stations: by the table, then by two of Newton's steps."""
        p = np.interp(station, knot_stations, knots)
        for _ in range(2):
            interval = np.clip(np.searchsorted(knots, p, "right") - 1, 0, count - 1)
            half_width = 0.5 * (p - knots[interval])
            nodes = (knots[interval] + half_width)[:, None] + half_width[:, None] * _NODES
            p = np.clip(
                p - (knot_stations[interval] + half_width * (speed(nodes) @ _WEIGHTS) - station) / speed(p), 0.0, end
            )
        return p

    def heading(station: Float) -> Float:
        """Return the headings (N,), rad, less the one at the start, at stations (N,), m."""
        p = parameter(station)
        # Headings are known but for full turns: the table says which one.
        wrapped_heading = np.arctan2(dv(p), du(p))
        rough_heading = np.interp(p, knots, knot_headings)
        return (
            wrapped_heading
            + 2.0 * np.pi * np.round((rough_heading - wrapped_heading) / (2.0 * np.pi))
            - knot_headings[0]
        )

    def curvature(station: Float) -> Float:
        """Return the curvatures (N,), 1/m, at stations (N,), m."""
        p = parameter(station)
        # Curvature of a plane curve: (u' v'' - v' u'') / |(u', v')|^3.
        return (du(p) * ddv(p) - dv(p) * ddu(p)) / speed(p) ** 3

    start = np.array([u_cubic(0.0), v_cubic(0.0)])
    return Curve(float(knot_stations[-1]), heading, curvature), float(knot_headings[0]), start


def cubic_up_to(v: Float, length: float) -> tuple[Curve, float, Float]:
    """Return the curve whose offset is a cubic (4,) of the distance along the tangent, up to an arc length (m).

    This is OpenDRIVE's `poly3`, whose u isn't the station. Results and errors are those of `cubic_curve`.
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
        element_length = curve.length / count
        # With the mean of the curvature over its length an element turns just as much as the curve does.
        mean_curvature = np.diff(curve.heading(knots)) / element_length
        half_change = 0.5 * np.diff(curve.curvature(knots))
        elements = [
            Element(element_length, m - h, m + h)
            for m, h in zip(mean_curvature.tolist(), half_change.tolist(), strict=True)
        ]
        deviation = float(np.hypot(*(Alignment(elements).position(station) - positions).T).max())
        if deviation <= tolerance or 2 * count > _MOST_PIECES:
            return elements, deviation
        count *= 2
