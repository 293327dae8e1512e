"""Take pictures beside a scan, project the cloud into one of them, and compare what both say."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from synthroads_addon import Job, generate, load_scenario, open_cloud
from synthroads_addon.base.errors import SynthRoadsError
from synthroads_addon.cloud.points import concatenate
from synthroads_addon.jobs.images.reader import read_images

SETTINGS = [
    *("road.length=80", "road.half_width=25", "scan.traffic_speed_factor=0", "scan.relief=0"),
    *("scan.noise={}", "scan.strip_errors={}", "scan.cameras.rig=kitti-stereo", "scan.cameras.spacing=30"),
    *("scan.cameras.megapixels=0.2", 'outputs=["cloud"]'),
]
NEAR, FAR = 4.0, 60.0


def main(output: Path) -> None:
    """Scan and photograph into a folder, draw the points over a picture, and print how well both agree."""
    generate(Job(load_scenario("mobile-mapping-300m", SETTINGS), output))
    with open_cloud(output / "cloud.laz") as cloud:
        points = concatenate(list(cloud.blocks()))
    image = read_images(output / "images")[0]
    place, distance = image.project(points.xyz)
    seen = np.flatnonzero(~np.isnan(place[:, 0]))
    column, row = np.floor(place[seen]).astype(int).T
    depth, instance = image.layer("depth")[row, column], image.layer("instance")[row, column]
    visible = np.abs(depth - distance[seen]) < 0.02 * distance[seen]  # the others are hidden
    same = instance[visible] == points.instance_id[seen[visible]]
    print(f"{len(seen):,} points lie in the picture of camera {image.camera}, {visible.sum():,} of them are visible")
    print(f"{same.mean():.1%} of these have the pixel's own instance")
    picture = image.layer("rgb")
    share = np.clip(np.log(distance[seen] / NEAR) / np.log(FAR / NEAR), 0.0, 1.0)[visible]
    colour = np.stack([255 * (1 - share), 255 * (1 - np.abs(2 * share - 1)), 255 * share], axis=1)
    overlay = picture.copy()
    overlay[row[visible], column[visible]] = colour
    Image.fromarray(np.concatenate([picture, overlay])).save(output / "overlay.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path, help="folder for the files")
    try:
        main(**vars(parser.parse_args()))
    except (SynthRoadsError, OSError) as error:
        parser.exit(2, f"error: {error}\n")
