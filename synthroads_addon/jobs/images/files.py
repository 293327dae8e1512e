"""`ImageFiles`: the images that a scenario's cameras take of a scan's scene, written as they are taken."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image as Picture

from ...base.arrays import Float, Float32, UInt8
from ...base.errors import InputError
from ...base.progress import StageTimer
from ...base.schema import canonical_json
from ...base.version import generator
from ...scanning.cameras.choice import CameraChoice
from ...scanning.cameras.exposures import Exposure, RigPoses, exposures_along, exposures_in_blocks
from ...scanning.cameras.point_colours import ColourCounts, ImageColours, Pixels, View
from ...scanning.cameras.rig import CameraRig, MountedCamera
from ...scanning.cameras.shooting import Image, Shooter
from ...scanning.cameras.sky import Surroundings
from ...scanning.colour.colour import LayerSource, MaterialLayers, takes_nodes
from ...scanning.parts.layers import Layers
from ...scanning.plan import ScanPlan
from ...scanning.platforms.path import Path as ScanPath
from ...scanning.record import Sink
from ...scanning.scan import BlockResult
from ...scenario.inputs import ScenarioInputs
from ...scenario.scenario import Scenario
from ..job_files import IMAGES
from .album import Album, Shot
from .colmap import write_colmap
from .kitti import write_kitti
from .nerfstudio import write_nerfstudio

MOST_INSTANCE = (1 << 24) - 1
"""Largest instance number that three bytes of a picture hold."""
PHOTOS = "photos"
"""Stage in which images are taken."""
_MOST_WAITING = 2
"""Images that wait to be written while others are taken."""
_MOST_OPEN = 24
"""Images whose pixels are kept in memory while points are coloured."""
_JPEG_QUALITY = 95
"""Chosen: hardly any loss."""


@dataclass
class ImageFiles:
    """Images of a scenario's cameras, into a folder.

    Attributes:
        scenario: the job; it has cameras.
        inputs: what the files that it names hold.
        folder: where the folder of the images goes.
        origin: (3,) map coordinates of the local origin that files of poses count from, m.
        path: of the scanner, over all of the scan.
        epsg: map coordinate system; None if unknown.
        album: the images so far.
        colour_counts: of points that were coloured from them.
    """

    scenario: Scenario
    inputs: ScenarioInputs
    folder: Path
    origin: Float
    path: ScanPath
    epsg: int | None = None
    album: Album = field(init=False)
    colour_counts: ColourCounts = field(default_factory=ColourCounts)
    _newest: list[Shot] = field(default_factory=list)

    def __post_init__(self) -> None:
        choice, rig = self.choice, self.rig
        ending = "jpg" if choice.picture == "jpeg" else "png"
        self.album = Album(choice.mounted(rig), np.array(self.origin, dtype=np.float64), ending)

    @property
    def choice(self) -> CameraChoice:
        """Return the scenario's cameras."""
        assert self.scenario.scan.cameras is not None
        return self.scenario.scan.cameras

    @property
    def rig(self) -> CameraRig:
        """Return the rig that the scenario names."""
        assert self.inputs.rig is not None
        return self.inputs.rig

    @cached_property
    def exposures(self) -> list[Exposure]:
        """Return the exposures of the whole scan, in the order of time."""
        return exposures_along(self.path, self.choice)

    def shoot(self, plan: ScanPlan, timer: StageTimer) -> None:
        """Take the images that lie in a plan's blocks of pulses, and write them; only in the main thread.

        Args:
            plan: of the scan, or of a section of it.
            timer: of the stage ``photos``.
        """
        exposures = self.exposures
        if plan.run.chosen_blocks is not None:
            exposures = exposures_in_blocks(exposures, plan.cut, plan.run.chosen_blocks)
        poses = self._poses(plan)
        self.album.mounts = [poses.camera_from_scanner(camera) for camera in self.album.cameras]
        tasks = [(camera, exposure) for exposure in exposures for camera in self.album.cameras]
        first_shot = len(self.album.shots)
        with timer.stage(PHOTOS), self._colours(plan) as source, ThreadPoolExecutor(1) as writer:
            shooter = Shooter(plan, self.choice, poses, *_lit(plan, source))
            waiting: list[Future[None]] = []
            for number, (camera, exposure) in enumerate(tasks):
                image = shooter.shoot(camera, exposure)
                shot = replace(self._shot(plan, poses, camera, exposure), stops=image.stops)
                while len(waiting) >= _MOST_WAITING:
                    waiting.pop(0).result()
                waiting.append(writer.submit(self.write, shot, image))
                self.album.shots.append(shot)
                timer.progress(PHOTOS, (number + 1) / len(tasks))
            for future in waiting:
                future.result()
        self._newest = self.album.shots[first_shot:]

    def coloured(self, sink: Sink) -> Sink:
        """Return what takes a scan's blocks for a sink: with colours from the images that were taken last, if wanted.

        Points of a section of a long road take them from the images of this section.
        """
        if self.choice.point_colours == "exact":
            return sink
        read = lru_cache(_MOST_OPEN)(self._pixels)
        views = [
            View(shot.number, shot.camera.lens, shot.position, shot.rotation, partial(read, number))
            for number, shot in enumerate(self._newest)
        ]
        return ColouringSink(sink, ImageColours(views, self.colour_counts))

    def _pixels(self, number: int) -> Pixels:
        """Return the pixels of one of the images that were taken last, from its files."""
        folder, shot, layers = self.folder / IMAGES, self._newest[number], self.choice.layers
        rgb = np.array(Picture.open(folder / self.path_of("rgb", shot)))
        depth = np.array(Picture.open(folder / self.path_of("depth", shot))) if "depth" in layers else None
        instance = None
        if "instance" in layers:
            parts = np.array(Picture.open(folder / self.path_of("instance", shot)), np.uint32)
            instance = parts[..., 0] | (parts[..., 1] << 8) | (parts[..., 2] << 16)
        return Pixels(rgb, depth, instance)

    def _poses(self, plan: ScanPlan) -> RigPoses:
        """Return the poses of the cameras in a plan's frame."""
        mounting = self.inputs.platform.mounting()
        reception = plan.reception
        return RigPoses(plan.path, mounting, reception.noise, reception.strip_errors, self.choice, plan.run.seed)

    def _shot(self, plan: ScanPlan, poses: RigPoses, camera: MountedCamera, exposure: Exposure) -> Shot:
        """Return the entry of an image in the album."""
        strip = next(strip for strip in plan.path.strips if strip.index == exposure.strip.index)
        here = replace(exposure, strip=strip)
        measured, true = poses.measured_pose(camera, here), poses.true_pose(camera, here)
        return Shot(
            camera=camera,
            number=exposure.number,
            strip=strip.index,
            time=exposure.time + plan.reception.epoch,
            position=measured.position + plan.target.origin,
            rotation=measured.rotation,
            true_position=true.position + plan.target.origin,
            true_rotation=true.rotation,
        )

    @contextmanager
    def _colours(self, plan: ScanPlan) -> Iterator[LayerSource | None]:
        """Context of the source of an image's colours; None without pictures."""
        layers: Layers = plan.layers
        if "rgb" not in self.choice.layers or layers.services is None or layers.request is None:
            yield None
            return
        settings = layers.request.settings
        if settings.source != "material" and not takes_nodes(settings):
            settings = replace(settings, source="nodes", engine="cycles", lighting="direct")
        request = replace(layers.request, names=frozenset({"rgb"}), settings=settings)
        with layers.services.layers(request, lambda share: None) as source:
            yield source

    def path_of(self, layer: str, shot: Shot) -> Path:
        """Return the file of a layer of an image, from the images' folder."""
        ending = {"rgb": self.album.picture, "depth": "tif", "normal": "exr"}.get(layer, "png")
        return Path(layer) / f"{shot.stem}.{ending}"

    def write(self, shot: Shot, image: Image) -> None:
        """Write the files of one image."""
        writers = {
            "rgb": lambda path: _write_picture(path, image.rgb),
            "depth": lambda path: _write_depth(path, image.depth),
            "normal": lambda path: _write_normals(path, image.normal),
            "class": lambda path: _write_picture(path, np.take(self.inputs.scheme.ids, image.class_id)),
            "instance": lambda path: _write_picture(path, instance_bytes(image.instance_id)),
        }
        for layer in self.choice.layers:
            path = self.folder / IMAGES / self.path_of(layer, shot)
            path.parent.mkdir(parents=True, exist_ok=True)
            writers[layer](path)

    def finish(self) -> None:
        """Write the files of poses and lenses, once all images are there."""
        folder = self.folder / IMAGES
        folder.mkdir(parents=True, exist_ok=True)
        write_colmap(folder / "colmap", self.album)
        write_nerfstudio(folder, self.album)
        write_kitti(folder / "kitti", self.album)
        (folder / "images.json").write_text(canonical_json(self.content()), encoding="utf-8")

    def content(self) -> dict[str, Any]:
        """Return the content of ``images.json``: everything that is known of the images."""
        poses = RigPoses(
            self.path,
            self.inputs.platform.mounting(),
            self.scenario.scan.noise,
            self.scenario.scan.strip_errors,
            self.choice,
            self.scenario.seed,
        )
        return {
            "type": "Images",
            "version": "1.0",
            "generator": generator(),
            "rig": self.rig.title,
            "origin": self.album.origin.tolist(),
            "epsg": self.epsg,
            "conventions": CONVENTIONS,
            "cameras": [self._camera(camera) for camera in self.album.cameras],
            "mounting_errors": poses.error_report(self.album.cameras),
            "classes": self.inputs.scheme.to_dict(),
            "images": [self._entry(shot) for shot in self.album.shots],
        }

    def _camera(self, camera: MountedCamera) -> dict[str, Any]:
        """Return a camera's lens, shutter and mounting as JSON data."""
        lens = camera.lens
        place, turn = self.album.mounts[camera.index] if self.album.mounts else (np.zeros(3), np.eye(3))
        return {
            "name": camera.camera.name,
            "model": lens.model,
            "width": lens.width,
            "height": lens.height,
            "focal": list(lens.focal),
            "centre": list(lens.centre),
            "radial": list(lens.radial),
            "tangential": list(lens.tangential),
            "largest_angle_deg": float(np.rad2deg(lens.reach)),
            "exposure_ms": camera.exposure * 1e3,
            "readout_ms": camera.readout * 1e3,
            "motion_blur": camera.blur,
            "scanner_from_camera": np.column_stack([turn, place]).tolist(),
        }

    def _entry(self, shot: Shot) -> dict[str, Any]:
        """Return what is known of an image as JSON data."""
        return {
            "camera": shot.camera.camera.name,
            "exposure": shot.number,
            "strip": shot.strip,
            "time": shot.time,
            "stops": round(shot.stops, 4),
            "files": {layer: self.path_of(layer, shot).as_posix() for layer in self.choice.layers},
            "position_map": shot.position.tolist(),
            "position_local": (shot.position - self.album.origin).tolist(),
            "quaternion": shot.quaternion.tolist(),
            "true_position_map": shot.true_position.tolist(),
            "true_rotation": shot.true_rotation.tolist(),
        }

    def summary(self) -> dict[str, Any]:
        """Return the counts of the images as JSON data, for the report."""
        pixels = sum(shot.camera.lens.width * shot.camera.lens.height for shot in self.album.shots)
        files = [path for path in (self.folder / IMAGES).rglob("*") if path.is_file()]
        return {
            "images": len(self.album.shots),
            "exposures": len({shot.number for shot in self.album.shots}),
            "pixels": pixels,
            "bytes": sum(path.stat().st_size for path in files),
        } | ({} if self.choice.point_colours == "exact" else {"point_colours": asdict(self.colour_counts)})


@dataclass(frozen=True)
class ColouringSink:
    """Sink that hands a scan's blocks on to another with colours from images.

    Attributes:
        sink: takes them.
        colours: of the images.
    """

    sink: Sink
    colours: ImageColours

    def write(self, result: BlockResult) -> None:
        """Take the result of a block, colour its points, and hand it on."""
        points = result.points
        rgb = self.colours.colours(points.xyz, points.rgb, points.instance_id)
        self.sink.write(replace(result, points=points.with_arrays({"rgb": rgb})))


CONVENTIONS = {
    "camera": "x right, y down, z along the axis; pixels from the upper left corner, the first pixel's middle is 0.5",
    "pose": "quaternion (w, x, y, z) from the camera's frame to the map's axes; measured, with the errors stated; "
    "true_rotation is a matrix (3, 3), row by row",
    "time": "s, of the middle of the exposure (of the middle row), as gps_time of points; row r of H rows is exposed "
    "readout_ms * ((r + 0.5) / H - 0.5) later",
    "depth": "32-bit float TIFF: distance from the optical centre along the pixel's ray, m; 0 where nothing is met",
    "normal": "16-bit float EXR: x, y, z in R, G, B along the map's axes, towards the camera; 0 where nothing is met",
    "class": "8-bit PNG: class_id of the cloud; 255 where nothing is met",
    "instance": "24-bit PNG: R + 256 G + 65536 B, as in COCO's panoptic format; 0 is none",
}
"""Contents of the files in words, as ``images.json`` says them."""


def instance_bytes(numbers: NDArray[np.uint32]) -> UInt8:
    """Return instance numbers (H, W) as three bytes (H, W, 3), the least first.

    Raises:
        InputError: a number is too large for three bytes.
    """
    if numbers.size and int(numbers.max()) > MOST_INSTANCE:
        raise InputError(
            "scan.cameras.layers", "instance", f"can't be written: there are more than {MOST_INSTANCE} instances"
        )
    return np.stack([(numbers >> shift).astype(np.uint8) for shift in (0, 8, 16)], axis=-1)


def _lit(plan: ScanPlan, source: LayerSource | None) -> tuple[LayerSource | None, Surroundings | None]:
    """Return a source of colours in the light of a plan's weather, and sky, far ground and air of its scene.

    The light becomes that below the layer of haze: fog takes the sun's, and gives its own. Where nothing is lit there
    are no surroundings.
    """
    request = plan.layers.request
    if source is None or request is None or request.settings.mode != "lit":
        return source, None
    means = getattr(source, "material", source)
    if not isinstance(means, MaterialLayers):
        return source, None
    surroundings = Surroundings(means.light, request.environment.cloud_cover, plan.atmosphere.extinction)
    hazy_means = replace(means, light=surroundings.light_below)
    if source is means:
        return hazy_means, surroundings
    source.material = hazy_means  # type: ignore[attr-defined] # a source of nodes
    return source, surroundings


def _write_picture(path: Path, pixels: UInt8 | None) -> None:
    """Write pixels (H, W) or (H, W, 3) as PNG, or as JPEG where the name ends so."""
    assert pixels is not None
    options: dict[str, Any] = {"quality": _JPEG_QUALITY} if path.suffix == ".jpg" else {"compress_level": 3}
    Picture.fromarray(np.ascontiguousarray(pixels)).save(path, **options)


def _write_depth(path: Path, depth: Float32) -> None:
    """Write distances (H, W), m, as TIFF of 32-bit floats."""
    Picture.fromarray(np.ascontiguousarray(depth, np.float32)).save(path, compression="tiff_adobe_deflate")


def _write_normals(path: Path, normals: Float32) -> None:
    """Write normals (H, W, 3) as EXR of 16-bit floats."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(normals, np.float16)}).write(str(path))
