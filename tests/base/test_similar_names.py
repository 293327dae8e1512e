"""Hints at what was meant: the names most like a wrong one, and none that are unlike it."""

from __future__ import annotations

import pytest

from synthroads_addon.base.errors import nearest_name, similar_names
from synthroads_addon.base.text.typed import similar_paths
from synthroads_addon.scenario.scenario import Scenario

DEVICES = ("ouster-os1-64", "riegl-vz-600i", "velodyne-hdl-32e", "velodyne-hdl-64e", "velodyne-vlp-16")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("VLP 16", ["velodyne-vlp-16"]),
        ("velodyne-vpl-16", ["velodyne-vlp-16"]),
        ("hdl", ["velodyne-hdl-32e", "velodyne-hdl-64e"]),
        ("vz600", ["riegl-vz-600i"]),
        ("", []),
        ("--", []),
        ("livox", []),
    ],
)
def test_names_like_a_wrong_one_are_found(name: str, expected: list[str]) -> None:
    assert similar_names(name, DEVICES) == expected


def test_an_option_that_is_unlike_all_others_gets_no_hint() -> None:
    assert nearest_name("--tripod", ["--road", "--seed", "--axis"]) == ""


def test_several_names_are_joined_by_or() -> None:
    hint = nearest_name("velodyne", DEVICES)
    assert hint == " (did you mean 'velodyne-hdl-32e', 'velodyne-hdl-64e' or 'velodyne-vlp-16'?)"


def test_paths_are_those_of_the_outermost_fields_of_a_name() -> None:
    assert similar_paths(Scenario, "lenght") == ["road.length"]
    assert similar_paths(Scenario, "Device") == ["scan.device"]
    assert similar_paths(Scenario, "nothing_like_that") == []
