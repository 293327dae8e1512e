"""Labelled points for tests of segmentation: a straight road with verge, shrubs and posts, without Blender."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ml.data.tiles import CloudTile
from ml.segmentation.recipes import SegmentationConfiguration
from synthroads_addon.base.classes import class_scheme
from synthroads_addon.cloud.formats.registry import open_writer
from synthroads_addon.cloud.points import PointBlock
from tests.helpers.clouds.road_tiles import road_points, road_tile

NAMES = tuple(row.name for row in class_scheme("5").rows)


def write_pointcept(root: Path, split: str, tiles: list[CloudTile], scheme: str = "5") -> Path:
    """Write tiles as a data set in Pointcept's layout; return its root."""
    folder = root / "pointcept" / f"classes-{scheme}"
    rows = class_scheme(scheme).rows
    for place, tile in enumerate(tiles):
        here = folder / split / f"{tile.scene}-{place}"
        here.mkdir(parents=True)
        np.save(here / "coord.npy", tile.coord)
        np.save(here / "color.npy", np.zeros((len(tile), 3), np.uint8) if tile.color is None else tile.color)
        np.save(here / "strength.npy", np.zeros((len(tile), 1)) if tile.strength is None else tile.strength[:, None])
        np.save(here / "segment.npy", tile.segment.astype(np.int32))
        (here / "tile.json").write_text(json.dumps({"scene": tile.scene, "origin": tile.origin.tolist()}))
    told = {"classes": [row.name for row in rows], "ids": [row.id for row in rows], "ignore_index": -1}
    (folder / "classes.json").write_text(json.dumps(told))
    return folder


def road_block(count: int, seed: int, length: float = 60.0) -> PointBlock:
    """Return the points as the scanner's: classes of the five, intensity 1 for a white target."""
    xyz, rgb, intensity, label = road_points(count, seed, length)
    zeros = np.zeros(count)
    return PointBlock(
        xyz=xyz + np.array([4e5, 5.6e6, 100.0]),
        intensity=intensity,
        rgb=(rgb.astype(np.uint16) * 257).astype(np.uint16),
        class_id=np.array([0, 1, 2, 3, 4], dtype=np.uint8)[label],
        instance_id=np.arange(count, dtype=np.uint32) % 7,
        return_number=np.ones(count, dtype=np.uint8),
        number_of_returns=np.ones(count, dtype=np.uint8),
        gps_time=np.arange(count) * 1e-5,
        scan_angle_deg=zeros.astype(np.float32),
        strip=np.zeros(count, dtype=np.uint16),
        range=zeros + 50.0,
        incidence_deg=zeros.astype(np.float32),
    )


def write_cloud(path: Path, block: PointBlock) -> Path:
    """Write a cloud of five classes."""
    scheme = class_scheme("5").as_stored()
    with open_writer(path, 25832, block.xyz[0], 65535.0, scheme=scheme) as writer:
        writer.write(block)
    return path


def toy(data: Path, **changes: Any) -> SegmentationConfiguration:
    """Return a configuration that is trained within a second or two."""
    sources = {name: [{"path": str(data / name), "split": "train"}] for name in ("real", "synthetic")}
    tests = {"unseen": [{"path": str(data / "real"), "split": "test"}]}
    base = {
        "task": "segmentation",
        "threads": 1,
        "device": "cpu",
        "voxel": 0.3,
        "crop_points": 800,
        "crops_per_tile": 4,
        "batch": 4,
        "set_up": "real",
        "network": {"preset": "S", "width": 8, "radius": 0.9, "neighbours": 8, "dropout": 0.1},
        "schedule": {"epochs": 2},
        "data": {**sources, "tests": tests},
    }
    return SegmentationConfiguration.from_dict({**base, **changes})


def weights(folder: Path) -> dict[str, torch.Tensor]:
    """Return the weights of a run."""
    state: dict[str, torch.Tensor] = torch.load(folder / "checkpoint.pt", weights_only=True)["model"]
    return state


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    """Return whether all weights are the same to the bit."""
    return all(torch.equal(one[name], other[name]) for name in one)


def write_two_domains(root: Path) -> Path:
    """Write small data sets `real` and `synthetic`, a road each to learn from and to test on; return their folder."""
    for name in ("real", "synthetic"):
        for split, seed in (("train", 1), ("test", 3)):
            write_pointcept(root / name, split, [road_tile(500, seed, f"{name}0", 1.0, 20.0)])
    return root
