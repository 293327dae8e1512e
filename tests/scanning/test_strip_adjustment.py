"""Errors of strips found again in the delivered points alone, by an adjustment that matches neighbouring strips."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from synthroads_addon.base.rotations import rotation_matrix
from synthroads_addon.scanning.devices.device import setting_of
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.strip_errors import StripErrors
from synthroads_addon.scenario.scan import ScanScenario
from tests.helpers.scenes.scan_scenes import ORIGIN, Standing, altered, mesh_of, scan_block, scan_of
from tests.helpers.scenes.scanners import device, mode

ERRORS = StripErrors(boresight_sigma_deg=0.05, lever_arm_sigma=0.05, drift_sigma=0.1)
LENGTH, CELL, RELIEF = 60.0, 12.0, 8.0
"""Of the flights and of the folded ground: its cells and the range of their corners' heights, m."""
ANGLES_WITHIN, SHIFTS_WITHIN = 0.003, 0.004
"""Tolerances, deg and m: a sixteenth of the standard deviation of the boresight, a 25th of that of the drift."""
CONTROL = np.array([(x, y) for x in (-24.0, -8.0, 8.0, 24.0) for y in (-24.0, -8.0, 8.0, 24.0)])
CONTROL_SIZE = 3.0
"""Middles of the patches that are known, and half their size, m."""
_NEIGHBOURS, _FLAT = 12, 0.02


class Crossing(Standing):
    """Four strips across one square: to, fro and aside, and two across them, one of them higher."""

    duration = 4.0
    strips = tuple(Strip(number, 100.0 * number, 4.0) for number in range(4))
    headings = (0.0, np.pi, np.pi / 2, -np.pi / 2)
    heights = (50.0, 50.0, 50.0, 80.0)
    asides = (-8.0, 8.0, 0.0, 5.0)

    def axes(self, strip):
        return rotation_matrix(np.array([self.headings[strip.index]]), np.zeros(1), np.zeros(1))[0]

    def pose(self, strip, time):
        axes = self.axes(strip)
        along = ((time - strip.start_time) / self.duration - 0.5) * LENGTH
        place = along[:, None] * axes[:, 0] + self.asides[strip.index] * axes[:, 1]
        place[:, 2] = self.heights[strip.index]
        return place, np.broadcast_to(axes, (len(time), 3, 3))


def folded_ground():
    """Return ground whose faces look into all directions."""
    count = int(2.4 * LENGTH / CELL)
    ticks = (np.arange(count + 1) - count / 2) * CELL
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    height = np.random.default_rng(5).uniform(-RELIEF, RELIEF, x.shape)
    corner = np.arange(x.size).reshape(x.shape)
    cells = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[:-1, 1:], corner[1:, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([cells[:, [0, 1, 3]], cells[:, [0, 3, 2]]])
    return mesh_of(np.stack([x, y, height], axis=-1).reshape(-1, 3), faces)


def delivered(plan):
    """Return each strip's points (N, 3), local, their arms from the planned path (N, 3), and shares of its time."""
    result = []
    for strip in plan.path.strips:
        blocks = [scan_block(plan, strip, number).points for number in plan.cut.block_numbers(strip)]
        place, time = (np.concatenate([getattr(one, name) for one in blocks]) for name in ("xyz", "gps_time"))
        place = place - ORIGIN
        inside = np.flatnonzero(np.abs(place[:, :2]).max(axis=1) < LENGTH / 2)
        place, time = place[inside], time[inside]
        pose, _ = plan.path.pose(strip, time)
        result.append((place, place - pose, (time - strip.start_time) / strip.duration))
    return result


def columns(strip, arm, share, axes, strips):
    """Return by how much unknowns (3 angles; begin and end of each strip) move points, (N, 3, unknowns)."""
    result = np.zeros((len(arm), 3, 3 + 6 * strips))
    for number, axis in enumerate((axes[:, 0], -axes[:, 1], axes[:, 2])):
        result[:, :, number] = np.cross(axis, arm)
    for number in range(3):
        result[:, number, 3 + 6 * strip + number] = 1.0 - share
        result[:, number, 6 + 6 * strip + number] = share
    return result


def control_points(ground):
    """Return points (N, 3), local, that a surveyor has measured: on a few patches of the ground, 0.5 m apart."""
    tick = np.arange(-CONTROL_SIZE, CONTROL_SIZE, 0.5)
    dots = np.stack(np.meshgrid(tick, tick), axis=-1).reshape(-1, 2)
    flat = np.concatenate([dots + place for place in CONTROL])
    corners = ground.vertices[ground.triangles].astype(float)
    result = []
    for a, b, c in corners:
        ways = np.column_stack([(b - a)[:2], (c - a)[:2]])
        u, v = np.linalg.solve(ways, (flat - a[:2]).T)
        inside = (u >= 0.0) & (v >= 0.0) & (u + v < 1.0)
        result.append(a + u[inside, None] * (b - a) + v[inside, None] * (c - a))
    return np.concatenate(result)


def adjusted(path, clouds, control):
    """Return boresight (3,), rad, and each strip's shifts at begin and end, (S, 2, 3), by matching all clouds in pairs.

    Points of a strip lie on the planes of another one's nearest points, or of the control's, but for what moves both.
    Without control a shift of all strips and a turn of them about the vertical would stay unknown.
    """
    still = np.zeros((len(control), 3)), np.zeros(len(control))
    rows, misses = [], []
    for a, (place, arm, share) in enumerate([*clouds, (control, *still)]):
        tree = cKDTree(place)
        for b, (other, other_arm, other_share) in enumerate(clouds):
            if a == b:
                continue
            distance, near = tree.query(other, k=_NEIGHBOURS)
            groups = place[near]
            middle = groups.mean(axis=1)
            values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", *(groups - middle[:, None],) * 2) / _NEIGHBOURS)
            normal = vectors[:, :, 0]
            flat = (np.sqrt(np.maximum(values[:, 0], 0.0)) < _FLAT) & (distance[:, -1] < 2.0) & (values[:, 1] > 0.01)
            moved = columns(b, other_arm, other_share, path.axes(path.strips[b]), len(clouds))
            if a < len(clouds):
                own = path.axes(path.strips[a])
                moved -= columns(a, arm[near].mean(axis=1), share[near].mean(axis=1), own, len(clouds))
            miss = np.einsum("ni,ni->n", normal, other - middle)
            chosen = np.flatnonzero(flat & (np.abs(miss) < 1.0))
            rows.append(np.einsum("ni,niu->nu", normal, moved)[chosen])
            misses.append(miss[chosen])
    matrix, miss = np.concatenate(rows), np.concatenate(misses)
    weight = np.ones(len(miss))
    for _ in range(8):
        # Points beside a fold lie on neither plane: they count less and less (Huber).
        found = np.linalg.lstsq(matrix * weight[:, None], miss * weight, rcond=None)[0]
        off = np.abs(miss - matrix @ found)
        weight = np.sqrt(np.minimum(1.0, 1.5 * np.median(off) / np.maximum(off, 1e-12)))
    return found[:3], found[3:].reshape(len(clouds), 2, 3)


@pytest.fixture(scope="module")
def plan():
    scan = {"device": "generic-polygon", "lines_per_second": 25.0}
    setting = setting_of(device(modes=[mode(5.0, 60.0, 500.0)]), ScanScenario.from_dict(scan))
    calm = scan_of(folded_ground(), 1, Crossing())
    setting = replace(setting, range_sigma=0.005, threshold=0.0, saturation=np.inf)
    return altered(calm, setting=setting, strip_errors=ERRORS)


def test_strip_adjustment_finds_the_errors_that_the_report_says(plan) -> None:
    path, report = plan.path, plan.summary()["strip_errors"]
    angles, shifts = adjusted(path, delivered(plan), control_points(folded_ground()))
    arm = np.array(report["lever_arm"])
    # An arm that is off by so much moves a whole strip as a drift does that is the same at begin and end.
    truth = np.array(
        [
            [np.array(row[end]) + path.axes(strip) @ arm for end in ("begin", "end")]
            for strip, row in zip(path.strips, report["strips"], strict=True)
        ]
    )
    np.testing.assert_allclose(np.rad2deg(angles), report["boresight_deg"], atol=ANGLES_WITHIN)
    np.testing.assert_allclose(shifts, truth, atol=SHIFTS_WITHIN)


def test_strip_adjustment_finds_none_where_there_is_none(plan) -> None:
    calm = altered(plan, strip_errors=StripErrors())
    angles, shifts = adjusted(plan.path, delivered(calm), control_points(folded_ground()))
    np.testing.assert_allclose(np.rad2deg(angles), 0.0, atol=ANGLES_WITHIN)
    np.testing.assert_allclose(shifts, 0.0, atol=SHIFTS_WITHIN)
