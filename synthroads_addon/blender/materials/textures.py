"""Images of a road's textures in the open file, and the means of a material that has them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...base.errors import InputError
from ...base.files import change_stamp
from ...base.turns.stepper import run_in_caller
from ...materials.table import Material
from ...materials.textures import texture_files
from ...road.surroundings import MaterialTexture
from .image import mean_pixel

SOURCE, STAMP, MEAN_PIXEL = "synthroads_texture", "synthroads_stamp", "synthroads_mean"
"""Custom properties of an image: its file, a stamp of the file's time of change and size, its mean linear colour."""
NORMAL_IMAGE = "synthroads_normal_image"
"""Custom property of a material whose textures have a normal image: its tile (m), and 1 where it lies along roads."""
_NUMBERS = ("roughness", "metallic", "specular")
_LARGEST = 1024
"""Side beyond which an image's mean is taken from a smaller copy, px; chosen."""


@dataclass(frozen=True)
class Texture:
    """Images in place of a material's layers.

    Attributes:
        images: image of each layer, by the layer's name; ``normal`` is a normal image.
        tile: length (m) that an image's width covers.
        along: whether images are placed by station and offset where the mesh has these, not by the place in the world.
    """

    images: Mapping[str, bpy.types.Image]
    tile: float
    along: bool

    @property
    def key(self) -> tuple[object, ...]:
        """Return an identity of the images and their files' states; it differs once a file has changed."""
        files = [(layer, image[SOURCE], image[STAMP]) for layer, image in self.images.items()]
        return *files, self.tile, self.along

    def entry(self, table: Material) -> Material:
        """Return a material of the table with the images' means in place of its own values."""
        means = {layer: tuple(image[MEAN_PIXEL]) for layer, image in self.images.items()}
        update = {name: means[name][0] for name in _NUMBERS if name in means}
        return table.model_copy(update=update | ({"base_color": means["base_color"]} if "base_color" in means else {}))

    def factors(self, table: Material, road_material: Material) -> dict[str, float | tuple[float, float, float]]:
        """Return factors of the layers' images by which their means become those of the road's material.

        Args:
            table: the material as the table has it.
            road_material: the material with the road's age and wetness.
        """
        image_means = self.entry(table)
        factors: dict[str, float | tuple[float, float, float]] = {
            name: _ratio(getattr(road_material, name), getattr(image_means, name)) for name in _NUMBERS
        }
        red, green, blue = map(_ratio, road_material.base_color, image_means.base_color)
        return factors | {"base_color": (red, green, blue)}


def load_texture(texture: MaterialTexture, along: bool) -> Texture:
    """Return the images of a texture, found in the open file or else read into it.

    If its folder is missing, because the file was made on another machine, the file's images of that folder are used.

    Raises:
        MissingFileError: the folder or a file is missing or can't be read.
        InputError: a file isn't named like a layer, or isn't an image; see `texture_files`.
    """
    images = _folder_images(texture.folder) if not Path(texture.folder).exists() else {}
    if not images:
        files = sorted(texture_files(texture.folder).items())
        images = {layer: _image(path.absolute(), f"SR {texture.material} {layer}", layer) for layer, path in files}
    return Texture(images, texture.tile, along)


def is_normal_image(image: bpy.types.Image | None) -> bool:
    """Return whether an image is the normal image of a road's texture."""
    return image is not None and SOURCE in image and Path(image[SOURCE]).stem.lower() == "normal"


def remove_unused_images() -> None:
    """Remove those images of textures from the file that no material uses."""
    bpy.data.batch_remove([image for image in bpy.data.images if SOURCE in image and not image.users])


@contextmanager
def packed_textures() -> Iterator[None]:
    """Context in which the file contains the textures' images, so that it can be saved for use elsewhere."""
    images = [image for image in bpy.data.images if SOURCE in image and image.packed_file is None]
    for image in images:
        image.pack()
    try:
        yield
    finally:
        for image in images:
            image.unpack(method="REMOVE")


def _ratio(value: float, mean: float) -> float:
    """Return value / mean, 1 if the mean is 0."""
    return value / mean if mean > 0.0 else 1.0


def _folder_images(folder: str) -> dict[str, bpy.types.Image]:
    """Return the file's images that were read from a folder, by layer."""
    absolute_folder = Path(folder).absolute()
    images = {
        Path(image[SOURCE]).stem.lower(): image
        for image in bpy.data.images
        if SOURCE in image and Path(image[SOURCE]).parent == absolute_folder and image.library is None
    }
    return dict(sorted(images.items()))


def _image(path: Path, name: str, layer: str) -> bpy.types.Image:
    """Return the image of a file: the open file's if it is up to date, else a new one."""
    stamp = "-".join(map(str, change_stamp(str(path), "an image is needed here")))
    for file_image in bpy.data.images:
        if file_image.get(SOURCE) == str(path) and file_image.get(STAMP) == stamp and file_image.library is None:
            return file_image
    image: bpy.types.Image = run_in_caller(lambda: _read(path))
    image.name, image.alpha_mode = name, "NONE"
    if layer != "base_color":
        image.colorspace_settings.name = "Non-Color"
    mean = mean_pixel(image, _LARGEST)
    if mean is None:
        bpy.data.images.remove(image)
        raise InputError(str(path), None, "cannot be read as an image: it is damaged, or of a kind that Blender lacks")
    image[SOURCE], image[STAMP] = str(path), stamp
    image[MEAN_PIXEL] = [min(1.0, max(0.0, value)) for value in mean]
    return image


def _read(path: Path) -> bpy.types.Image:
    """Read an image from a file."""
    try:
        return bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError as error:
        raise InputError(str(path), None, f"cannot be read as an image ({str(error).strip()})") from None
