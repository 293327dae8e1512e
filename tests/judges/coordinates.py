"""Names of coordinate systems in our files, judged by pyproj."""

from __future__ import annotations

import json
import re
from xml.etree import ElementTree

import numpy as np

from tests.judges.samples import Samples

_NEAR = 1e-6
"""Degrees by which places may differ... no map does: rounding of PROJ's parameters alone."""


def verdict(samples: Samples) -> list[str]:
    """Return the files whose coordinate system puts the road elsewhere than its EPSG code does."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    place = samples.road.transform.translate[:2]
    wanted = Transformer.from_crs(samples.road.metadata.epsg, 4258, always_xy=True).transform(*place)
    found = []
    for name, text in _named(samples).items():
        try:
            there = Transformer.from_crs(text, 4258, always_xy=True).transform(*place)
        except ProjError as fault:
            found.append(f"{name}: {fault}")
            continue
        if not np.allclose(there, wanted, rtol=0.0, atol=_NEAR):
            found.append(f"{name}: the road lies at {there} and not at {wanted}")
    return found


def _named(samples: Samples) -> dict[str, str]:
    """Return what each file says of its coordinate system."""
    import laspy
    import pye57

    xodr = ElementTree.parse(samples.file("twin.xodr")).getroot()
    (ifc,) = re.findall(r"=IFCPROJECTEDCRS\('([^']*)'", samples.text("twin.ifc"))
    with laspy.open(samples.file("cloud.laz")) as reader:
        laz = next(record for record in reader.header.vlrs if record.record_id == 2112).string
    with pye57.E57(str(samples.file("cloud.e57"))) as file:
        e57 = file.root["coordinateMetadata"].value()
    return {
        "twin.xodr": xodr.findtext("header/geoReference") or "",
        "twin.ifc": ifc,
        "twin.city.json": json.loads(samples.text("twin.city.json"))["metadata"]["referenceSystem"],
        "twin.geojson": json.loads(samples.text("twin.geojson"))["crs"]["properties"]["name"],
        "cloud.laz": laz,
        "cloud.e57": e57,
    }


def with_another_meridian(samples: Samples) -> Samples:
    """Return files with an OpenDRIVE file in the zone beside."""
    return samples.with_text("twin.xodr", "+lon_0=9", "+lon_0=15")
