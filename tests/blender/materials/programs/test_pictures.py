"""Image textures give what Cycles gives; images that can't be looked up so are left to it, by name."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from tests.helpers.scenes.node_cases import Case, deviations

CLOSEST = 1e-5
WIDTH, HEIGHT = 13, 9
_FORMATS = {"png": "PNG", "jpg": "JPEG", "tga": "TARGA", "exr": "OPEN_EXR"}
IMAGES = {
    "bytes": (False, "sRGB", None),
    "numbers in bytes": (False, "Non-Color", None),
    "linear bytes": (False, "Linear Rec.709", "png"),
    "png": (False, "sRGB", "png"),
    "numbers in a png": (False, "Non-Color", "png"),
    "jpg": (False, "sRGB", "jpg"),
    "tga": (False, "sRGB", "tga"),
    "floats": (True, "Linear Rec.709", None),
    "numbers": (True, "Non-Color", None),
    "exr": (True, "Linear Rec.709", "exr"),
    "numbers in an exr": (True, "Non-Color", "exr"),
}
"""Images: whether of floats, space of their colours, and the kind of file that they are in."""


def _image(folder: Path, floats: bool, space: str, kind: str | None, alpha: str | None = None) -> bpy.types.Image:
    """Return an image; `alpha` is the mode of one whose alpha varies."""
    image = bpy.data.images.new("Made", WIDTH, HEIGHT, alpha=alpha is not None, float_buffer=floats)
    # Before the pixels, as it clears them.
    image.colorspace_settings.name = space
    pixels = np.random.default_rng(4).uniform(0.0, 1.0, (HEIGHT, WIDTH, 4)).astype(np.float32)
    if floats:
        pixels[:, :, :3] *= 3.0
    if alpha is None:
        pixels[:, :, 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    if kind is not None:
        image.filepath_raw, image.file_format = str(folder / f"image.{kind}"), _FORMATS[kind]
        image.save()
        image = bpy.data.images.load(image.filepath_raw)
        image.colorspace_settings.name = space
    if alpha is not None:
        image.alpha_mode = alpha
    return image


def _cases(image: bpy.types.Image) -> Iterator[tuple[str, Case]]:
    ways = product(("Closest", "Linear", "Cubic", "Smart"), ("REPEAT", "EXTEND", "CLIP", "MIRROR"), ("Color", "Alpha"))
    for interpolation, extension, output in ways:
        if output == "Color" or (interpolation, extension) == ("Linear", "CLIP"):  # the alpha varies at its end alone
            settings: dict[str, Any] = {"image": image, "interpolation": interpolation, "extension": extension}
            name = f"{interpolation} {extension} {output}"
            yield name, Case("TexImage", output, {"Vector": ("a", None)}, {}, settings, "far_and_near")


@pytest.mark.parametrize("name", IMAGES)
def test_images_are_looked_up_as_by_cycles(name: str, tmp_path: Path) -> None:
    found = deviations(dict(_cases(_image(tmp_path, *IMAGES[name]))))
    assert {case: apart for case, apart in found.items() if apart != pytest.approx(0.0, abs=CLOSEST)} == {}


@pytest.mark.parametrize("alpha", ["NONE", "CHANNEL_PACKED"])
def test_an_alpha_that_stays_apart(alpha: str, tmp_path: Path) -> None:
    cases = dict(_cases(_image(tmp_path, False, "sRGB", "png", alpha)))
    found = deviations(cases)
    assert {case: apart for case, apart in found.items() if apart != pytest.approx(0.0, abs=CLOSEST)} == {}


def _one(image: bpy.types.Image, **settings: Any) -> dict[str, Case]:
    own = {"image": image, **settings}
    return {"it": Case("TexImage", "Color", {"Vector": ("a", None)}, {}, own, set_up=_nothing)}


def _nothing(node: Any) -> None:
    """Leave the node as it is."""


def _moved(node: Any) -> None:
    node.texture_mapping.translation = (0.5, 0.0, 0.0)


def test_images_of_other_kinds_are_left_to_cycles(tmp_path: Path) -> None:
    plain = _image(tmp_path, False, "sRGB", None)
    assert deviations(_one(_image(tmp_path, False, "sRGB", "png", "STRAIGHT"))) == {
        "it": "Image Texture: Transparent Image"
    }
    assert deviations(_one(_image(tmp_path, True, "sRGB", None))) == {"it": "Image Texture: Colours Of Srgb"}
    assert deviations(_one(plain, projection="SPHERE")) == {"it": "Image Texture: Sphere"}
    case = Case("TexImage", "Color", {"Vector": ("a", None)}, {}, {"image": plain}, set_up=_moved)
    assert deviations({"it": case}) == {"it": "Image Texture: Texture Mapping"}
