"""Render a road whose asphalt is paved with setts by images: the picture of `docs/textures.md`.

    python studies/surfaces/textures.py --output docs/pictures/textures.png

The images are drawn here: base colour, roughness, and normals that round the stones' edges.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.arrays import Float  # noqa: E402
from synthroads_addon.blender.files import empty_file  # noqa: E402
from synthroads_addon.blender.model.build import build_road  # noqa: E402
from synthroads_addon.blender.things.model_builder import BuildRequest  # noqa: E402
from synthroads_addon.blender.views import pictures  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.road.surroundings import Environment  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402

SIZE, ROWS, STONES = 512, 8, 4
"""Side of the images, px; rows of stones in them, and stones in a row."""
TILE = 2.0
SEED = 4
LIMITS = ("road.length=160", "road.barriers.noise_barrier=1", "road.pavement.concrete=0")


def main() -> None:
    """Draw the images, build the road and render it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--width", type=int, default=800)
    parser.add_argument("--samples", type=int, default=12)
    options = parser.parse_args()
    empty_file()
    with tempfile.TemporaryDirectory() as folder:
        for layer, pixels in setts().items():
            save_image(Path(folder) / "asphalt" / f"{layer}.png", pixels)
        render(folder, options.output, options.width, options.samples)


def setts() -> dict[str, Float]:
    """Return images (SIZE, SIZE, 3) of stones by layer, 0 to 1, the lowest row first."""
    height, width = np.mgrid[:SIZE, :SIZE] / SIZE
    row = np.floor(height * ROWS)
    along_stone = width * STONES + 0.5 * (row % 2)
    stone_shades = (row * 7 + np.floor(along_stone) % STONES * 3) % 5
    along_stone, across_stone = along_stone % 1.0, height * ROWS % 1.0
    to_end, to_side = 2.0 * np.minimum(along_stone, 1.0 - along_stone), np.minimum(across_stone, 1.0 - across_stone)
    edge = np.minimum(to_end, to_side)
    is_joint = (edge < 0.07)[..., None]
    shades = np.stack([0.35 + 0.055 * stone_shades, 0.345 + 0.047 * stone_shades, 0.33 + 0.047 * stone_shades], axis=-1)
    tilt = 0.5 * (edge < 0.2)
    normals = np.stack(
        [
            tilt * (to_end < to_side) * np.sign(along_stone - 0.5),
            tilt * (to_end >= to_side) * np.sign(across_stone - 0.5),
            np.sqrt(1.0 - tilt**2),
        ],
        axis=-1,
    )
    roughness = np.where(is_joint, 0.94, 0.55 + 0.04 * stone_shades[..., None])
    return {
        "base_color": np.where(is_joint, 0.15, shades),
        "roughness": np.repeat(roughness, 3, axis=-1),
        "normal": normals * 0.5 + 0.5,
    }


def save_image(path: Path, pixels: Float) -> None:
    """Write pixels (H, W, 3) as they are to a PNG file; makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image = bpy.data.images.new(path.stem, pixels.shape[1], pixels.shape[0], is_data=True)
    image.pixels.foreach_set(np.dstack([pixels, np.ones(pixels.shape[:2])]).astype(np.float32).ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def render(textures: str, path: Path, width: int, samples: int) -> None:
    """Build a road with the textures of a folder and render it from a driver's place."""
    limits = load_scenario("rq31-600m-even", list(LIMITS)).road.model_copy(update={"textures": textures})
    light = Environment(sun_azimuth_deg=140.0, sun_elevation_deg=38.0)
    parameters = sample_road(limits, SEED, "").model_copy(update={"environment": light})
    model, geometry = build_road(BuildRequest(parameters, 0.01, 0.3)), RoadGeometry(parameters)
    eye, aim = geometry.point(np.array([20.0, 60.0]), np.array([-6.0, -8.0])) + parameters.transform.translate
    pictures.light(light)
    pictures.camera(eye - model.origin + [0.0, 0.0, 2.2], aim - model.origin + [0.0, 0.0, 0.3])
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, False
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format, scene.render.filepath = "PNG", str(path.absolute())
    bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
