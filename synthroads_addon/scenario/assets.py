"""Libraries of free assets: objects out of .blend, .glb and .obj files, with their class and where they are placed."""

import os
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from ..base.errors import InputError, MissingFileError
from ..base.files import PRESETS, change_stamp
from ..base.named_paths import path_inside
from ..base.schema import ClosedModel, quantity, read_json
from ..road.things.asset import AssetTypes
from ..road.things.limits import Interval, interval

SUFFIXES = (".blend", ".glb", ".obj")
LIBRARIES = PRESETS / "assets"
FARTHEST = 100.0
"""Largest offset of an object, m."""

_ALLOWED = {"distance": (0.0, 1000.0), "spacing": (0.5, 1e6), "per_km": (0.0, 1e4), "rotation_deg": (-360.0, 360.0)}


class AssetPlacement(ClosedModel):
    """Where copies of an asset stand."""

    side: Literal["left", "right", "both", "median"] = Field(description="Side of the road, or in the median.")
    distance: Interval = Field(
        description="Behind the verge's outer edge; in the median from the pavement's inner edge.",
        json_schema_extra={"unit": "m"},
    )
    spacing: Interval | None = Field(
        None, description="Between one and the next along the road.", json_schema_extra={"unit": "m"}
    )
    per_km: Interval | None = Field(
        None, description="How many, at random along the road, instead.", json_schema_extra={"unit": "1/km"}
    )
    start_station: float = quantity(0.0, "m", "Where they begin.", (0, None))
    end_station: float | None = quantity(None, "m", "Where they end; the road's end if not given.", (0, None))
    rotation_deg: Interval = interval(0.0, 0.0, "deg", "About the vertical; at 0 it faces its side's traffic.")

    @model_validator(mode="after")
    def _check_placement(self) -> Self:
        """Refuse spacing with or without per_km, intervals beyond their limits, and an end before the start."""
        if (self.spacing is None) == (self.per_km is None):
            raise ValueError("either spacing or per_km is needed, and not both")
        for name, (least, most) in _ALLOWED.items():
            limits = getattr(self, name)
            if limits and (limits.minimum < least or limits.maximum > most):
                raise ValueError(f"{name} is {limits.minimum:g} to {limits.maximum:g}: must be {least:g} to {most:g}")
        if self.end_station is not None and self.end_station < self.start_station:
            raise ValueError(f"end_station is {self.end_station:g}: must not be less than {self.start_station:g}")
        return self


class LibraryAsset(ClosedModel):
    """One asset: its file, its semantic class, and how it is placed."""

    file: str = Field(description="File (.blend, .glb, .obj), relative to the library's folder, with / in between.")
    object: str | None = Field(
        None, description="Name of the object in a .blend file; all of its objects if not given."
    )
    class_name: str = Field(
        min_length=1, max_length=64, description="Semantic class of its faces: of the 17, or of a scheme of one's own."
    )
    scale: float = quantity(1.0, "1", "Scale.", gt=0, le=100)
    twin_types: AssetTypes | None = Field(
        None, description="Types in the twin formats; those of its class if not given."
    )
    placement: AssetPlacement

    @field_validator("file")
    @classmethod
    def _check_path(cls, file: str) -> str:
        """Refuse a file of another kind, or one that doesn't lie in the library's folder."""
        path = PurePosixPath(file)
        if path.suffix.lower() not in SUFFIXES:
            raise ValueError(f"'{file}' must be one of {', '.join(SUFFIXES)}")
        if path.is_absolute() or "\\" in file or ":" in file or ".." in path.parts:
            raise ValueError(f"'{file}' must lie in the library's folder: a relative path with / and without ..")
        return file

    @model_validator(mode="after")
    def _check_object(self) -> Self:
        """Refuse the name of an object in a file that has none."""
        if self.object is not None and not self.file.lower().endswith(".blend"):
            raise ValueError(f"object is '{self.object}': only a .blend file has named objects to choose from")
        return self


class AssetLibrary(ClosedModel):
    """Assets by name."""

    type: Literal["AssetLibrary"] = "AssetLibrary"
    version: Literal["1.0"] = "1.0"
    assets: dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")], LibraryAsset] = Field(
        min_length=1, description="Assets by name."
    )


def library_names() -> list[str]:
    """Return the sorted names of the built-in asset libraries."""
    return sorted(path.parent.name for path in LIBRARIES.glob("*/library.json"))


def library_file(name_or_file: str) -> Path:
    """Return the file of a built-in asset library of this name, else the name itself as a path."""
    return LIBRARIES / name_or_file / "library.json" if name_or_file in library_names() else Path(name_or_file)


def read_asset_library(name_or_file: str | os.PathLike[str]) -> AssetLibrary:
    """Return an asset library, whose assets' files are there; the last ones read are cached until they change.

    Raises:
        MissingFileError: the library, or a file that it names, doesn't exist or cannot be read.
        InputError: a field is unknown or wrong, or a file lies outside of the library's folder, links resolved.
    """
    name = str(library_file(os.fspath(name_or_file)))
    library = _read_library(name, change_stamp(name, "an asset library (JSON) is needed here"))
    for key, asset in library.assets.items():
        field = f"{name}: assets.{key}.file"
        _check_file(path_inside(Path(name).parent, asset.file, field, follow=True), field, asset.file)
    return library


@lru_cache(maxsize=8)
def _read_library(path: str, _stamp: tuple[int, int]) -> AssetLibrary:
    """Read an asset library; the cache keeps the last ones read, by path and change stamp."""
    return AssetLibrary.from_dict(read_json(path), source=path)


def _check_file(path: Path, field: str, file_name: str) -> None:
    """Raise MissingFileError if a file can't be read, InputError if it is empty."""
    try:
        with path.open("rb") as file:
            is_empty = not file.read(1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MissingFileError(field, file_name, f"cannot be read ({reason})") from None
    if is_empty:
        raise InputError(field, file_name, "the file is empty")
