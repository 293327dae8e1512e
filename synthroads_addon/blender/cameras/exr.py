"""Reading rendered layers from EXR files, and writing images of numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray


def read_layers(path: Path) -> dict[str, NDArray[Any]]:
    """Return a multilayer EXR file's channels (H, W), rows from the top, by name without the view layer's.

    Blender 4.5 writes all channels into one part, 5.2 a part for each pass; both names end alike, such as
    ``roughness.X``, ``Depth.Z`` and ``Combined.R``.
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name.split(".", 1)[1]: channel.pixels for part in file.parts for name, channel in part.channels.items()}


def write_image(path: Path, values: NDArray[np.float32]) -> None:
    """Write (H, W, 3) float32 numbers, rows from the top, as an uncompressed EXR file."""
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(values, np.float32)}).write(str(path))
