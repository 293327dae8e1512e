"""Prints the edges of all lanes of an OpenDRIVE file as ad-map-access reads them: JSON, geocentric coordinates."""

from __future__ import annotations

import json
import sys
from pathlib import Path


def main() -> None:
    """Read the file that the command names, and print its edges."""
    import ad_map_access as ad

    kinds = ad.map.intersection.IntersectionType.TrafficLight, ad.map.landmark.TrafficLightType.SOLID_RED_YELLOW_GREEN
    ad.map.access.initFromOpenDriveContent(Path(sys.argv[1]).read_text(encoding="utf-8"), 0.05, *kinds)
    found = []
    for number in ad.map.lane.getLanes():
        lane = ad.map.lane.getLane(number)
        for edge in (lane.edge_left, lane.edge_right):
            found.append([[p.x.mECEFCoordinate, p.y.mECEFCoordinate, p.z.mECEFCoordinate] for p in edge.ecef_points])
    print(json.dumps(found))


if __name__ == "__main__":
    main()
