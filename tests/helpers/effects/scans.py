"""The scan of small roads on which fields are looked at: sparse, quick, with whatever a field may change."""

from pathlib import Path
from typing import Any

FILES = Path(__file__).parent / "files"
SCAN: dict[str, Any] = {
    "fidelity": "draft",
    "vegetation_detail": 1.0,
    "scan": {
        "device": str(FILES / "scanner.json"),
        "lines_per_second": 20.0,
        "rays_per_pulse": 1,
        "platform": {"kind": "uav", "height": 30.0, "speed": 10.0, "lateral_offsets": [0.0]},
    },
    "colour": {"source": "material", "max_resolution": 256, "image_spacing": 60.0, "ground_sampling_distance": 0.25},
    "road": {},
}
"""A draft by a UAV, coloured by the materials' means; as JSON data."""
