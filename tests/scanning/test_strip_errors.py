"""Errors of strips: their distribution, what they do to points, and that the report says them."""

import numpy as np
import pytest
from scipy import stats

from synthroads_addon.base.rotations import rotation_matrix
from synthroads_addon.scanning.platforms.path import Strip
from synthroads_addon.scanning.strip_errors import (
    Outage,
    StripErrors,
    boresight,
    drift,
    lever_arm,
    outage_peak,
    strip_error_report,
    strip_gain,
)
from tests.helpers.scenes.scan_scenes import Standing, altered, plane, scan_block, scan_of

ERRORS = StripErrors(boresight_sigma_deg=0.02, lever_arm_sigma=0.05, drift_sigma=0.1)


class TwoStrips(Standing):
    """Two strips from the same place, turned to the left of the east by an angle, rad."""

    strips = (Strip(0, 0.0, 0.2), Strip(1, 10.2, 0.2))

    def __init__(self, heading: float = 0.0) -> None:
        super().__init__()
        self.axes = rotation_matrix(np.array([heading]), np.zeros(1), np.zeros(1))[0]

    def pose(self, strip, time):
        place, _ = super().pose(strip, time)
        return place, np.broadcast_to(self.axes, (len(time), 3, 3))


def test_errors_are_normal_and_each_strip_drifts_by_itself() -> None:
    seeds = range(400)
    drifts = [np.concatenate(drift(ERRORS, seed, strip)) for seed in seeds for strip in (0, 1)]
    values = [
        np.rad2deg([boresight(ERRORS, seed) for seed in seeds]) / 0.02,
        np.array([lever_arm(ERRORS, seed) for seed in seeds]) / 0.05,
        np.array(drifts).reshape(400, 12) / 0.1,
    ]
    for part in values:
        counts = np.bincount((stats.norm.cdf(part.ravel()) * 20).astype(int), minlength=20)
        assert stats.chisquare(counts).pvalue > 0.001
    together = np.corrcoef(np.concatenate(values, axis=1).T)
    assert np.abs(together[~np.eye(18, dtype=bool)]).max() < 5 / np.sqrt(400)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_points_are_off_by_what_the_report_says_and_the_truth_is_kept(heading: float) -> None:
    path = TwoStrips(heading)
    plan = scan_of(plane(), 1, path)
    wrong = altered(plan, strip_errors=ERRORS)
    report = wrong.summary()["strip_errors"]
    roll, pitch, yaw = np.deg2rad(report["boresight_deg"])
    for strip, row in zip(plan.path.strips, report["strips"], strict=True):
        calm, points = (scan_block(one, strip, 0).points for one in (plan, wrong))
        np.testing.assert_array_equal(points.true_xyz, calm.xyz)
        share = (points.gps_time - strip.start_time) / strip.duration
        arm = calm.xyz - calm.scanner
        # Small angles, about the scanner's axes. Pitch is nose up.
        turned = np.cross(path.axes @ np.array([roll, -pitch, yaw]), arm)
        shift = np.array(row["begin"]) + share[:, None] * (np.array(row["end"]) - np.array(row["begin"]))
        expected = shift + path.axes @ np.array(report["lever_arm"]) + turned
        np.testing.assert_allclose(points.xyz - calm.xyz, expected, atol=1e-3)
    assert report["strips"][0]["begin"] != report["strips"][1]["begin"]


def test_strips_are_as_bright_as_the_report_says() -> None:
    plan = scan_of(plane(), 1, TwoStrips())
    brighter = altered(plan, strip_errors=StripErrors(gain_sigma_db=1.0, gain_step_db=1.5))
    for strip, row in zip(plan.path.strips, brighter.summary()["strip_errors"]["strips"], strict=True):
        calm, points = (scan_block(one, strip, 0).points for one in (plan, brighter))
        np.testing.assert_allclose(points.intensity, calm.intensity * 10 ** (row["gain_db"] / 10), rtol=1e-6)
        np.testing.assert_array_equal(points.xyz, calm.xyz)
    levels = [10 * np.log10(strip_gain(brighter.reception.strip_errors, seed, 3)) + 0.75 for seed in range(400)]
    counts = np.bincount((stats.norm.cdf(levels) * 20).astype(int), minlength=20)
    assert stats.chisquare(counts).pvalue > 0.001


def test_strips_differ_by_their_step_by_turns_and_the_report_says_so() -> None:
    plan = altered(scan_of(plane(), 1, TwoStrips()), strip_errors=StripErrors(gain_step_db=1.4))
    gains = [row["gain_db"] for row in plan.summary()["strip_errors"]["strips"]]
    np.testing.assert_allclose(gains, [0.7, -0.7], atol=1e-6)


def test_the_position_errs_in_an_outage_and_the_report_says_how_much() -> None:
    plan = scan_of(plane(), 1, TwoStrips())
    first, second = plan.path.strips
    outage = Outage(second.index, second.start_time, second.start_time + second.duration)
    lost = altered(plan, strip_errors=StripErrors(outage_sigma=100.0), outages=(outage,))
    np.testing.assert_array_equal(scan_block(lost, first, 0).points.xyz, scan_block(plan, first, 0).points.xyz)
    calm, points = (scan_block(one, second, 0).points for one in (plan, lost))
    (row,) = lost.summary()["strip_errors"]["outages"]
    share = (points.gps_time - second.start_time) / second.duration
    expected = (16.0 * (share * (1.0 - share)) ** 2)[:, None] * np.array(row["peak"])
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(points.xyz - calm.xyz, expected, atol=2e-3 * np.abs(row["peak"]).max() + 1e-3)
    peaks = [outage_peak(StripErrors(outage_sigma=1.0), seed, Outage(0, 0.0, 60.0)) for seed in range(300)]
    assert np.std(peaks) == pytest.approx(1.0, rel=0.1)
    # Eight times the duration: the error grows with its power 1.5.
    long, short = (outage_peak(StripErrors(outage_sigma=1.0), 1, Outage(0, 0.0, end)) for end in (80.0, 10.0))
    np.testing.assert_allclose(long, short * 8.0**1.5)


def test_nothing_is_reported_or_moved_without_errors() -> None:
    assert strip_error_report(StripErrors(), 1, TwoStrips.strips) == {}
    assert "strip_errors" not in scan_of(plane()).summary()
