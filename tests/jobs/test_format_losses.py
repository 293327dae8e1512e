"""Contents and losses of each format: as the files really come back, and as the pages say."""

from __future__ import annotations

import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.jobs.format_losses import format_losses, format_names

LABELS = {"class", "instance", "return", "returns", "time", "strip"}


@pytest.mark.parametrize("name", ["laz", "las", "copc.laz", "ply", "pcd", "npz"])
def test_every_cloud_keeps_class_instance_and_time(name: str) -> None:
    losses = format_losses(name)
    assert set(losses.holds) >= LABELS
    assert losses.source.is_file()


def test_clouds_lose_what_their_fields_are_too_small_for() -> None:
    las, ply, pcd, npz = (format_losses(name) for name in ("las", "ply", "pcd", "npz"))
    assert {"coordinates to 0.0005 m", "intensity to 16 bits, and clipped beyond", "range to 5e-05 m"} <= set(las.loses)
    assert {"flags", "colours"} <= set(las.holds)
    assert set(ply.loses) == {"colours to 8 bits", "without flags"}
    assert "coordinates" in ply.holds
    assert {text.partition(" to ")[0] for text in pcd.loses} == {"coordinates", "colours", "without flags"}
    assert npz.loses == ("without flags",)


def test_models_say_what_their_reports_say() -> None:
    assert any("GeoPackage" in format_losses(name).label for name in format_names())
    opendrive = " ".join(format_losses("opendrive").loses)
    assert "OpenDRIVE has no ground beside its lanes" in opendrive
    assert "it is no lane" in " ".join(format_losses("lanelet2").loses)
    assert any(text.startswith("Vehicle") for text in format_losses("cityjson").loses)


def test_each_format_has_its_source_and_an_unknown_one_is_refused() -> None:
    for name in ("kitti", "semantickitti", "nuscenes", "openlabel", "blend", "usd", "gltf", "3dtiles"):
        losses = format_losses(name)
        assert losses.source.is_file()
        assert losses.holds
        assert losses.loses
    with pytest.raises(InputError, match="openlabel"):
        format_losses("openlable")
