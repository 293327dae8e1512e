"""The sun's place by time: known days and places, symmetry about noon, and what a scenario makes of it."""

import math

import pytest

from synthroads_addon.road.things.limits import Interval
from synthroads_addon.sampling.conflicts import conflicts
from synthroads_addon.sampling.sun_place import sun_angles
from synthroads_addon.sampling.surroundings import sample_environment
from synthroads_addon.scenario.road import EnvironmentLimits, RoadScenario


@pytest.mark.parametrize(
    ("hour", "day", "latitude", "azimuth", "elevation"),
    [
        (12.0, 172, 51.0, 180.0, 62.44),  # summer solstice: 90 - 51 + 23.44
        (12.0, 355, 51.0, 180.0, 15.56),
        (0.0, 172, 51.0, 0.0, -15.56),
        (6.0, 80, 51.0, 90.0, 0.0),  # equinox
        (18.0, 80, 51.0, 270.0, 0.0),
        (12.0, 355, -30.0, 0.0, 83.44),
        (12.0, 80, 0.0, None, 90.0),
    ],
)
def test_known_places_of_the_sun(
    hour: float, day: int, latitude: float, azimuth: float | None, elevation: float
) -> None:
    found_azimuth, found_elevation = sun_angles(hour, day, latitude)
    assert found_elevation == pytest.approx(elevation, abs=0.5 if azimuth is None else 0.15)
    if azimuth is not None:
        assert abs((found_azimuth - azimuth + 180.0) % 360.0 - 180.0) < 0.15


def test_the_sun_sets_as_it_rose() -> None:
    for hours in (1.0, 4.5, 8.0):
        (east, before), (west, after) = (sun_angles(12.0 + sign * hours, 120, 48.0) for sign in (-1.0, 1.0))
        assert before == pytest.approx(after)
        assert east + west == pytest.approx(360.0)
        assert east < 180.0


def night(**fields: object) -> RoadScenario:
    return RoadScenario(environment=EnvironmentLimits(sun_place="time", **fields))


def test_a_time_of_day_places_the_sun() -> None:
    at = {"day_of_year": Interval(minimum=172.0, maximum=172.0)}
    evening = Interval(minimum=22.0, maximum=22.0)
    drawn = sample_environment(night(time_of_day=evening, **at), 3)
    azimuth, elevation = sun_angles(22.0, 172, 51.0)
    assert drawn.sun_azimuth_deg == pytest.approx(azimuth, rel=1e-5)
    assert drawn.sun_elevation_deg == pytest.approx(elevation, rel=1e-5)
    assert elevation < -10.0
    north = sample_environment(night(time_of_day=evening, latitude_deg=66.0, **at), 3)
    assert north.sun_elevation_deg > elevation + 10.0
    spring = sample_environment(night(time_of_day=evening, day_of_year=Interval(minimum=80.0, maximum=80.0)), 3)
    assert spring.sun_elevation_deg < elevation - 10.0
    drawn_times = {sample_environment(night(), seed).sun_elevation_deg for seed in range(20)}
    assert len(drawn_times) == 20


def test_the_rest_of_the_environment_stays() -> None:
    for seed in range(10):
        by_angles, by_time = sample_environment(RoadScenario(), seed), sample_environment(night(), seed)
        angles = {"sun_azimuth_deg", "sun_elevation_deg"}
        assert by_angles.model_dump(exclude=angles) == by_time.model_dump(exclude=angles)


def test_hours_and_days_beyond_their_limits_are_named() -> None:
    late = night(time_of_day=Interval(minimum=20.0, maximum=25.0), day_of_year=Interval(minimum=0.0, maximum=9.0))
    sentences = "; ".join(conflicts(late))
    assert "environment.time_of_day.maximum is 25, at most 24 is allowed" in sentences
    assert "environment.day_of_year.minimum is 0, at least 1 is allowed" in sentences
    assert not math.isnan(sun_angles(24.0, 366, 90.0)[1])
