"""Lasers of one head may fire at once: their pulses stay pulses of their own."""

from dataclasses import replace

import numpy as np

from synthroads_addon.scanning.finish import read_echoes
from tests.helpers.scenes.scan_scenes import plane, scan_block, scan_of


def test_pulses_of_one_time_keep_all_their_echoes_when_intensities_are_read_late() -> None:
    plan = scan_of(plane(), 1)
    found = scan_block(plan, plan.path.strips[0], 0)
    at_once = replace(found.points, gps_time=np.zeros(len(found.points)))
    read = read_echoes(replace(found, points=at_once, readout=None), plan)
    assert len(read.points) == len(found.points) > 1000
    np.testing.assert_array_equal(read.points.number_of_returns, 1)
