"""Scans of what is clear in places: counted points, shared energy, the same bytes on any cores, named faults."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import bpy
import laspy
import numpy as np
import pytest

from headless.commands import command
from tests.helpers.scenes.transparent_files import FILES, gltf, png
from tests.helpers.scenes.transparent_materials import CASES, Nodes, add_card, add_ground, half

SCAN = ["--height", "30", "--set", "scan.noise.range_sigma=0", "--set", "scan.noise.speckle=0"]
SCAN += ["--set", "scan.lines_per_second=50", "--set", 'outputs=["cloud"]', "--set", "scan.noise.angle_sigma_mrad=0"]
SCAN += [
    "--set",
    "scan.noise.dropout=0",
    "--set",
    "scan.noise.position_sigma=0",
    "--set",
    "scan.noise.attitude_sigma_deg=0",
]
SCAN += ["--set", "scan.noise.heading_sigma_deg=0", "--set", "cloud.intensity=range_corrected"]
FOOTPRINT = 0.05
"""Half a texel and a footprint's half width, m."""


def scan(scene: Path, output: Path, *more: str) -> laspy.LasData:
    assert command("scan", [str(scene), "--output", str(output), *SCAN, *more, "--quiet"]) == 0
    return laspy.read(output / "cloud.laz")


def warnings(output: Path) -> list[str]:
    return json.loads((output / "report.json").read_text())["warnings"]


@pytest.fixture
def roof(tmp_path: Path) -> Callable[[str], Path]:
    """Return a function that saves a scene of a roof of 20 m x 20 m, 3 m above the ground, by its material."""

    def save(name: str) -> Path:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        nodes = Nodes()
        CASES[name].build(nodes)
        add_ground()
        add_card(nodes.item, 20.0)
        path = tmp_path / f"{name}.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        return path

    return save


@pytest.mark.any_blender
@pytest.mark.parametrize("rays", ["1", "7"])
def test_half_of_a_roof_returns_and_the_ground_below_has_the_rest(
    rays: str, roof: Callable[[str], Path], tmp_path: Path
) -> None:
    solid = scan(roof("solid"), tmp_path / "solid", "--rays", rays)
    las = scan(roof("alpha of an image"), tmp_path / "clear", "--rays", rays)
    # The image begins anew at the very edge, as it does in a render.
    on_roof, all_of_roof = (data.xyz[(data.z > 2.0) & (data.x < 9.9)] for data in (las, solid))
    assert len(all_of_roof) > 20_000
    assert on_roof[:, 0].max() < FOOTPRINT
    assert len(on_roof) == pytest.approx((all_of_roof[:, 0] < 0.0).sum(), rel=0.01)
    if rays == "1":
        assert len(las) == len(solid)  # what the roof doesn't return, the ground does
    below = las.xyz[(las.z < 1.0) & (np.abs(las.y) < 8.0)]
    inside = (below[:, 0] > 1.0) & (below[:, 0] < 8.0)
    assert inside.sum() == pytest.approx(7.0 / 40.0 * (np.abs(solid.y) < 8.0).sum(), rel=0.25)
    (warning,) = warnings(tmp_path / "clear")
    assert warning.startswith(f"{len(las):,} points have no class")


def test_a_half_clear_blend_shares_the_energy(roof: Callable[[str], Path], tmp_path: Path) -> None:
    """A roof of alpha 0.3 gives 0.3 of a solid one's echo, and the ground below 0.7 of what it gives without a roof."""
    bare = scan(roof("alpha of 0"), tmp_path / "bare", "--rays", "1")
    solid = scan(roof("solid"), tmp_path / "solid", "--rays", "1")
    las = scan(roof("alpha of 0.3"), tmp_path / "blend", "--rays", "1")

    def by_time(data: laspy.LasData, where: np.ndarray) -> dict[float, float]:
        return dict(zip(np.array(data.gps_time)[where].tolist(), np.array(data.intensity)[where].tolist(), strict=True))

    under = {"roof": by_time(las, las.z > 2.0), "ground": by_time(las, las.z < 1.0)}
    whole = {"roof": by_time(solid, solid.z > 2.0), "ground": by_time(bare, bare.z < 1.0)}
    times = set(under["roof"])
    assert len(times) > 20_000
    assert times == set(whole["roof"])
    for part, share in (("roof", 0.3), ("ground", 0.7)):
        both = sorted(times & set(under[part]) & set(whole[part]))
        assert len(both) > 0.99 * len(times)
        ratio = np.array([under[part][time] / whole[part][time] for time in both])
        assert np.median(ratio) == pytest.approx(share, abs=0.002)
        assert np.abs(ratio - share).max() < 0.01
    number = np.array(las.number_of_returns)
    assert set(number[las.z > 2.0].tolist()) == {2}


def test_the_same_bytes_on_any_number_of_cores_and_the_same_points_by_both_casters(
    roof: Callable[[str], Path], tmp_path: Path
) -> None:
    file, clouds = roof("blend of an image"), []
    for name, word in (("one", "scan.threads=1"), ("three", "scan.threads=3"), ("own", 'scan.caster="bvhtree"')):
        sparse = ("--set", "scan.lines_per_second=20", "--rays", "7")
        clouds.append(scan(file, tmp_path / name, *sparse, "--set", word))
    assert (tmp_path / "one" / "cloud.laz").read_bytes() == (tmp_path / "three" / "cloud.laz").read_bytes()
    assert len(clouds[2]) == pytest.approx(len(clouds[0]), abs=5)  # on an edge each caster has a ray's face its own way
    for height in (0.0, 3.0):
        mine, other = (data.intensity[np.abs(data.z - height) < 0.1].sum(dtype=float) for data in clouds[::2])
        assert other == pytest.approx(mine, rel=1e-4)


def test_a_card_that_is_clear_by_three_quarters_returns_from_a_quarter(tmp_path: Path) -> None:
    alpha = half()
    alpha[: len(alpha) // 2] = 0.0
    material = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    gltf(material, alpha)(tmp_path / "card.glb")
    gltf({}, None)(tmp_path / "solid.glb")
    las, solid = (scan(tmp_path / f"{name}.glb", tmp_path / name, "--rays", "1") for name in ("card", "solid"))
    returned = las.xyz[las.z > 2.0]
    assert len(returned) == pytest.approx((solid.z > 2.0).sum() / 4.0, rel=0.05)
    assert returned[:, 0].max() < FOOTPRINT
    assert returned[:, 1].min() > -FOOTPRINT
    assert len(las) == len(solid)


@pytest.mark.any_blender
def test_colours_of_what_is_missing_are_those_of_its_socket(tmp_path: Path) -> None:
    """By nodes, by the materials and by a renderer's images: no magenta, no brighter echo, and the file is named."""
    FILES["OBJ picture alone"].write(tmp_path / "card.obj")
    (tmp_path / "a.png").unlink()
    FILES["OBJ mask"].write(tmp_path / "plain.obj")
    (tmp_path / "plain.mtl").write_text("newmtl Clear\nKd 0.1 0.5 0.1\n")
    (tmp_path / "a.png").unlink()
    for source in ("nodes", "material", "images"):
        more = ["--rays", "1", "--set", f'colour.source="{source}"', "--set", 'colour.mode="unlit"']
        more += ["--set", "colour.image_spacing=60", "--set", "colour.ground_sampling_distance=0.5"]
        card, plain = (
            scan(tmp_path / f"{name}.obj", tmp_path / f"{name}-{source}", *more) for name in ("card", "plain")
        )
        for name in ("red", "green", "blue", "intensity"):
            mine, wanted = (np.median(np.array(las[name])[las.z > 2.0]) for las in (card, plain))
            assert mine == pytest.approx(wanted, rel=0.03), (source, name)
        found = warnings(tmp_path / f"card-{source}")
        assert any("a.png' of the material Clear is missing or can't be read" in text for text in found), found


def test_what_cannot_be_worked_out_is_named(roof: Callable[[str], Path], tmp_path: Path) -> None:
    scan(roof("noise"), tmp_path / "out", "--rays", "1")
    text = "the transparency of the material 'Clear' can't be worked out (Noise Texture"
    assert any(entry.startswith(text) for entry in warnings(tmp_path / "out"))


def test_a_picture_of_the_file_is_written_as_it_is_read() -> None:
    """The table's own pictures: a PNG of an alpha is read back as that alpha."""
    path = Path(bpy.app.tempdir) / "alpha.png"
    path.write_bytes(png(half()))
    image = bpy.data.images.load(str(path))
    values = np.empty(len(half()) ** 2 * 4, np.float32)
    image.pixels.foreach_get(values)
    assert np.array_equal(values.reshape(*half().shape, 4)[..., 3], half())
