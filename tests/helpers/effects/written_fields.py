"""Fields of a scenario that say how a job is done, or what is written, and what alone they may change."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Written:
    """A field that changes no point.

    Attributes:
        value: another value.
        changes: files that are others then.
        ties: files that may be others too, where rays meet edges; which do depends on the processor.
        adds: files that are there then only.
        removes: files that aren't there then.
        same: least share of the points that are the same.
        digits: by how much colours and intensities of a point, of 65,535, may differ and count as the same.
    """

    value: Any
    changes: frozenset[str] = frozenset()
    ties: frozenset[str] = frozenset()
    adds: frozenset[str] = frozenset()
    removes: frozenset[str] = frozenset()
    same: float = 1.0
    digits: int = 0


OF_OTHER_SCENES = {"tolerance.layers"}
"""Fields that matter in scenes of others alone: on a road's materials layers but the colour don't vary."""
CLOUD = frozenset({"cloud.laz"})
WRITTEN: dict[str, Written] = {
    "title": Written("Another", changes=frozenset({"parameters.json", "twin.ifc"})),
    "scan.section_length": Written(25.0),
    "scan.most_pulses": Written(10**9),
    # Where a ray passes the edge of two faces, casters may choose either.
    "scan.caster": Written("bvhtree", ties=CLOUD | {"preview_intensity.png"}, same=0.999),
    # Beside that, Cycles works materials out, whose last digits are others.
    "scan.kernels": Written("off", ties=CLOUD | {"preview_intensity.png", "preview_rgb.png"}, same=0.9999, digits=1),
    "scan.threads": Written(2),
    "scan.footprints": Written("where_needed"),
    "cloud.formats": Written(["laz", "npz"], adds=frozenset({"cloud.npz"})),
    "cloud.attributes": Written(["normal"], changes=CLOUD),
    "outputs": Written(["cloud", "previews", "parameters"], removes=frozenset({"centerline.geojson"})),
    "twin": Written(["geojson", "ifc"], adds=frozenset({"twin.geojson", "twin-geojson-report.json"})),
    "ifc.placement": Written("local", changes=frozenset({"twin.ifc"})),
}
"""Path of a field -> what it says."""
