"""nerfstudio's ``transforms.json``: https://docs.nerf.studio/quickstart/data_conventions.html."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...base.schema import canonical_json
from ...scanning.cameras.lens import Lens
from .album import GRAPHICS_AXES, Album

_MODELS = {"pinhole": "OPENCV", "fisheye": "OPENCV_FISHEYE", "equirectangular": "EQUIRECTANGULAR"}


def write_nerfstudio(folder: Path, album: Album) -> None:
    """Write an album's poses and lenses into a folder; a file of them holds one model of lenses.

    It is ``transforms.json`` of the first camera's model; another model's is in ``transforms_MODEL.json``.
    """
    for number, model in enumerate(album.models):
        name = "transforms.json" if number == 0 else f"transforms_{model}.json"
        (folder / name).write_text(canonical_json(_content(album, model)), encoding="utf-8")


def _content(album: Album, model: str) -> dict[str, Any]:
    """Return the content of the file of a model's images as JSON data."""
    frames = []
    for shot in album.of_model(model):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = shot.rotation @ GRAPHICS_AXES, shot.position - album.origin
        frames.append(
            {
                "file_path": f"rgb/{shot.stem}.{album.picture}",
                **_intrinsics(shot.camera.lens),
                "transform_matrix": matrix.tolist(),
            }
        )
    return {"camera_model": _MODELS[model], "frames": frames}


def _intrinsics(lens: Lens) -> dict[str, Any]:
    """Return a lens's parameters in nerfstudio's names: principal points count as `lens` does."""
    values: dict[str, Any] = {"w": lens.width, "h": lens.height}
    if lens.model == "equirectangular":
        # There, half the width is the focal length: places over it are azimuths from -1 to 1, as shares of half a turn.
        half = lens.width / 2.0
        return values | {"fl_x": half, "fl_y": half, "cx": half, "cy": lens.height / 2.0}
    values |= {"fl_x": lens.focal[0], "fl_y": lens.focal[1], "cx": lens.centre[0], "cy": lens.centre[1]}
    values |= {f"k{number}": value for number, value in enumerate((*lens.radial, 0.0, 0.0, 0.0, 0.0)[:4], 1)}
    return values | ({"p1": lens.tangential[0], "p2": lens.tangential[1]} if lens.model == "pinhole" else {})
