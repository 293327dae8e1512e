"""Folders of textures: images that take the place of materials' layers, found by their names.

    textures/
        asphalt/                a material of the table
            fresh/              a set of images; of several one is drawn by the road's seed
                base_color.png
                roughness.png
                texture.json    {"tile": 3.0}
            worn/
                base_color.jpg
        paint_white/            without folders inside it is itself the one set
            normal.exr

What is no image is left alone in all of them, such as a licence; so is what begins with a dot.
"""

from collections.abc import Iterator
from pathlib import Path

from ..base.errors import InputError, MissingFileError, nearest_name
from ..base.pictures import TEXTURE_KINDS, picture_kind
from ..base.schema import ClosedModel, quantity, read_json
from ..road.surroundings import MaterialTexture
from .table import materials

TEXTURE_LAYERS = ("base_color", "roughness", "metallic", "specular", "normal")
"""Layers that an image can give: names of its file."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff")
SETTINGS = "texture.json"
"""File beside the images of a set, or of all sets of a material, that says how large they are."""

_WANTED = "a folder of textures is needed here"
_LAYERS_NAMED = f"{', '.join(TEXTURE_LAYERS[:-1])} or {TEXTURE_LAYERS[-1]}"


class TextureSettings(ClosedModel):
    """Content of ``texture.json``."""

    tile: float = quantity(
        MaterialTexture.model_fields["tile"].default, "m", "Length that an image's width covers.", gt=0, le=1000
    )


def texture_sets(folder: str) -> dict[str, tuple[MaterialTexture, ...]]:
    """Return the sets of images in a folder of textures by material, in the order of their names.

    Raises:
        MissingFileError: the folder, or one of its files, isn't there or can't be read.
        InputError: a folder in it is named after no material, a set has no image of a layer, an image is named after
            no layer or isn't one, or there are no materials at all.
    """
    sets = {path.name: tuple(_sets_of(path)) for path in _folders(Path(folder))}
    if not sets:
        raise InputError(folder, None, "must hold a folder named after a material of the table, such as asphalt")
    return sets


def texture_files(folder: str) -> dict[str, Path]:
    """Return the images of a set's folder, by the layers that they give.

    Raises:
        MissingFileError: the folder isn't there, or a file can't be read.
        InputError: an image is named after no layer, or after one that another gives, or isn't one; there are none.
    """
    images: dict[str, Path] = {}
    for path in _entries(Path(folder)):
        if path.suffix.lower() not in SUFFIXES or path.is_dir():
            continue
        layer = path.stem.lower()
        if layer not in TEXTURE_LAYERS:
            allowed_text = f"an image must be named after a layer: {_LAYERS_NAMED}{nearest_name(layer, TEXTURE_LAYERS)}"
            raise InputError(str(path), None, allowed_text)
        if layer in images:
            raise InputError(str(path), None, f"{images[layer].name} gives the same layer: leave one of them out")
        _check_image(path)
        images[layer] = path
    if not images:
        kinds = ", ".join(SUFFIXES)
        raise InputError(folder, None, f"holds no image of a layer: {_LAYERS_NAMED}, with one of {kinds}")
    return images


def _sets_of(folder: Path) -> Iterator[MaterialTexture]:
    """Yield the sets of a material: each folder in its own, or that itself."""
    if folder.name not in materials():
        allowed_text = f"no material of the table has this name{nearest_name(folder.name, materials())}"
        raise InputError(str(folder), None, allowed_text)
    usual_tile = _tile_of(folder, TextureSettings().tile)
    for path in _folders(folder) or [folder]:
        texture_files(str(path))
        yield MaterialTexture(material=folder.name, folder=str(path), tile=_tile_of(path, usual_tile))


def _tile_of(folder: Path, usual_tile: float) -> float:
    """Return the length (m) that an image's width covers by a folder's ``texture.json``; the usual one without any."""
    path = folder / SETTINGS
    if not path.is_file():
        return usual_tile
    data = read_json(path)
    settings = TextureSettings.from_dict(data, source=str(path))
    return settings.tile if "tile" in data else usual_tile


def _folders(folder: Path) -> list[Path]:
    """Return the folders in a folder, sorted by name."""
    return [path for path in _entries(folder) if path.is_dir()]


def _entries(folder: Path) -> list[Path]:
    """Return what lies in a folder, sorted by name, without what is hidden."""
    try:
        return sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except (OSError, ValueError) as error:  # ValueError: its name holds a null byte
        reason = getattr(error, "strerror", None) or error
        raise MissingFileError(str(folder), None, f"{_WANTED} ({reason})") from None


def _check_image(path: Path) -> None:
    """Raise an error if a file doesn't begin as an image does."""
    try:
        kind = picture_kind(path)
    except OSError as error:
        raise MissingFileError(str(path), None, f"an image is needed here ({error.strerror})") from None
    if kind not in TEXTURE_KINDS:
        raise InputError(str(path), None, "is no PNG, JPEG, OpenEXR or TIFF image")
