"""Directions of single pulses, pattern by pattern, in the frame of their head: x forward, y left, z up.

Every function takes the numbers of pulses of one head and answers for each by itself: nothing is summed up from pulse
to pulse, so that the billionth is as exact as the first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..devices.device import ScannerSetting
from .models import FULL_TURN, Grid, OscillatingMirror, PolygonMirror, RotatingHead, RotatingMirror, WedgePrism

Float = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class Rays:
    """What is known of P pulses of a head.

    Attributes:
        time: (P,) s since the head began to scan.
        scan_angle: (P,) rad, see `pattern.Shots`.
        direction: (3, P) unit vectors.
        in_plane, across: (3, P) unit vectors across the beam; None if not asked for.
        beam: (P,) number of the beam; None if there is only one.
    """

    time: Float
    scan_angle: Float
    direction: Float
    in_plane: Float | None = None
    across: Float | None = None
    beam: Numbers | None = None


def cycle_lines(setting: ScannerSetting) -> int:
    """Return the lines after which a head's directions repeat; 0 if they don't."""
    pattern = setting.device.pattern
    if isinstance(pattern, WedgePrism):
        return 0
    if isinstance(pattern, Grid):
        return pattern.rows
    return 2 if isinstance(pattern, OscillatingMirror) else 1


def rays(setting: ScannerSetting, pulse: Numbers, with_frame: bool) -> Rays:
    """Return pulses (P,) of a head by their numbers from 0."""
    pattern = setting.device.pattern
    if isinstance(pattern, WedgePrism):
        return _wedge_prism(pattern, setting, pulse, with_frame)
    if isinstance(pattern, RotatingHead):
        return _rotating_head(pattern, setting, pulse, with_frame)
    return _line(pattern, setting, pulse, with_frame)


def _line(
    pattern: RotatingMirror | PolygonMirror | OscillatingMirror | Grid,
    setting: ScannerSetting,
    pulse: Numbers,
    with_frame: bool,
) -> Rays:
    """Return pulses of lines across the forward direction.

    Line k begins at k / lines per second, and its N pulses follow at the pulse rate. Pulse j is j - (N - 1) / 2 steps
    from the middle of the field of view; the swings of an oscillating mirror alternate.
    """
    line, within = np.divmod(pulse, setting.pulses_per_line)
    time = line / setting.lines_per_second + within / setting.pulse_rate
    place = within - (setting.pulses_per_line - 1) / 2.0
    if isinstance(pattern, OscillatingMirror):
        np.negative(place, where=line % 2 == 1, out=place)
    if isinstance(pattern, OscillatingMirror) and pattern.motion == "sinusoidal":
        swing = place * (math.pi * setting.lines_per_second / setting.pulse_rate)
        angle = setting.field_of_view / 2.0 * np.sin(swing)
    else:
        angle = place * setting.angle_step
    angle += math.radians(pattern.centre_from_nadir_deg)
    forward = None
    if isinstance(pattern, Grid):
        row = line % pattern.rows - (pattern.rows - 1) / 2.0
        forward = row * (math.radians(pattern.along_field_deg) / pattern.rows)
    return _fan(time, angle, forward, with_frame)


def _fan(time: Float, angle: Float, forward: Float | None, with_frame: bool) -> Rays:
    """Return rays at angles (P,) from the nadir, in planes that are tilted forward by angles (P,), None for 0.

    direction = cos(angle) down + sin(angle) right, where down = (sin(forward), 0, -cos(forward)).
    """
    sine, cosine = np.sin(angle), np.cos(angle)
    nodding = (0.0, 1.0) if forward is None else (np.sin(forward), np.cos(forward))
    direction = np.empty((3, len(angle)))
    np.multiply(cosine, nodding[0], out=direction[0])
    np.negative(sine, out=direction[1])
    np.multiply(cosine, -nodding[1], out=direction[2])
    if not with_frame:
        return Rays(time, angle, direction)
    in_plane, across = np.empty_like(direction), np.zeros_like(direction)
    np.multiply(sine, -nodding[0], out=in_plane[0])
    np.negative(cosine, out=in_plane[1])
    np.multiply(sine, nodding[1], out=in_plane[2])
    across[0], across[2] = nodding[1], nodding[0]
    return Rays(time, angle, direction, in_plane, across)


def _rotating_head(pattern: RotatingHead, setting: ScannerSetting, pulse: Numbers, with_frame: bool) -> Rays:
    """Return pulses of a rotating head.

    Turn k begins at k / lines per second. Its S firing sequences begin a step apart, from S / 2 steps left of the
    forward direction on; the head turns on while the beams of a sequence fire.
    """
    sequence_time = pattern.beams / setting.pulse_rate
    delays = np.arange(pattern.beams) * (sequence_time / pattern.beams)
    if pattern.firing_times_us is not None:
        delays = np.array(pattern.firing_times_us) * 1e-6
    order = np.argsort(delays, kind="stable")
    turn, within = np.divmod(pulse, setting.pulses_per_line)
    sequence, place = np.divmod(within, pattern.beams)
    beam = order[place]
    since = sequence * sequence_time + delays[beam]
    middle = setting.pulses_per_line / pattern.beams / 2.0
    azimuth = (sequence - middle) * setting.angle_step + delays[beam] * (FULL_TURN * setting.lines_per_second)
    elevation = np.deg2rad(pattern.elevations_deg)
    up, out = np.sin(elevation)[beam], np.cos(elevation)[beam]
    sine, cosine = np.sin(azimuth), np.cos(azimuth)
    time = turn / setting.lines_per_second + since
    direction = np.stack([out * cosine, -out * sine, up])
    if not with_frame:
        return Rays(time, azimuth, direction, beam=beam)
    in_plane = np.stack([-sine, -cosine, np.zeros_like(sine)])
    across = np.stack([-up * cosine, up * sine, out])
    return Rays(time, azimuth, direction, in_plane, across, beam)


def _wedge_prism(pattern: WedgePrism, setting: ScannerSetting, pulse: Numbers, with_frame: bool) -> Rays:
    """Return pulses of one or two rotating wedges.

    Pulse p is fired at p / pulse rate. Wedge i has then turned by p x lines/s x turns_i / (turns_1 x pulse rate) turns.
    """
    first = pattern.wedges[0].turns
    forward, right = np.zeros(len(pulse)), np.zeros(len(pulse))
    for wedge in pattern.wedges:
        turned = pulse * (setting.lines_per_second * wedge.turns / first / setting.pulse_rate)
        # Only the fraction counts: the sine of a large angle would lose what the product still has.
        phase = FULL_TURN * (turned - np.floor(turned))
        forward, right = _refracted(forward, right, phase, math.radians(wedge.angle_deg), wedge.refractive_index)
    down = np.sqrt(1.0 - forward * forward - right * right)
    time, angle = pulse / setting.pulse_rate, np.arctan2(right, down)
    direction = np.stack([forward, -right, -down])
    if not with_frame:
        return Rays(time, angle, direction)
    return Rays(time, angle, direction, *_carried(forward, right, down))


def _refracted(forward: Float, right: Float, phase: Float, apex: float, index: float) -> tuple[Float, Float]:
    """Return the components across the axis of unit vectors that have passed a wedge.

    Snell's law in vector form: at a face with unit normal N (along the light), u in a medium of index n1 becomes v with
    n2 v = n1 u + k N, k = sqrt(n2^2 - n1^2 + (n1 u.N)^2) - n1 u.N. The first face lies across the axis, so that the
    components across the axis, times the index, stay as they are; the second one's normal leans by the apex angle away
    from the thick side, to which the light is bent. ``phase`` is the thick side's direction, from forward to the right.
    """
    lean_forward, lean_right = -math.sin(apex) * np.cos(phase), -math.sin(apex) * np.sin(phase)
    along_axis = np.sqrt(index * index - forward * forward - right * right)
    along_normal = forward * lean_forward + right * lean_right + math.cos(apex) * along_axis
    push = np.sqrt(1.0 - index * index + along_normal * along_normal) - along_normal
    return forward + push * lean_forward, right + push * lean_right


def _carried(forward: Float, right: Float, down: Float) -> tuple[Float, Float]:
    """Return the right and the forward axis, carried from the nadir to the beam by the shortest turn (3, P).

    A wedge deflects a beam without turning its cross-section. A vector e across the axis a becomes
    e - (e.d) / (1 + a.d) (a + d) for the direction d.
    """
    share_right, share_forward = right / (1.0 + down), forward / (1.0 + down)
    in_plane = np.stack([-share_right * forward, share_right * right - 1.0, share_right * (1.0 + down)])
    across = np.stack([1.0 - share_forward * forward, share_forward * right, share_forward * (1.0 + down)])
    return in_plane, across
