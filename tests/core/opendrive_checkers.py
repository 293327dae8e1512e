"""Programs of others that check or read OpenDRIVE, run in an environment of their own where there is one."""

from __future__ import annotations

import json
import os
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

PYTHON = os.environ.get("SYNTHROADS_OPENDRIVE_PYTHON") or str(
    Path(__file__).parents[2] / ".venv-opendrive" / "bin" / "python"
)
"""Made by `python3.11 -m venv .venv-opendrive` and `pip install asam-qc-opendrive pyxodr ad-map-access` in it."""

NOT_APPLICABLE = "check_asam_xodr_junctions_connection_one_connection_element"
"""The one check of the 23 that says of itself that it isn't for OpenDRIVE 1.8."""

_CHECK = """
import json, logging, sys
logging.disable(logging.CRITICAL)
from qc_baselib import Configuration, Result
from qc_opendrive import constants
from qc_opendrive.main import run_checks
found = {}
for path in sys.argv[1:]:
    config, result = Configuration(), Result()
    config.set_config_param("InputFile", path)
    result.register_checker_bundle(name=constants.BUNDLE_NAME, description="", version="1", summary="")
    result.set_result_version(version="1")
    run_checks(config, result)
    checks = result._report_results.checker_bundles[0].checkers
    found[path] = {c.checker_id: [c.status.value, [i.description for i in c.issues]] for c in checks}
json.dump(found, sys.stdout)
"""

_PYXODR = """
import json, sys
from pyxodr.road_objects.network import RoadNetwork
road = RoadNetwork(sys.argv[1], resolution=float(sys.argv[2])).get_roads()[0]
found = []
for section in road.lane_sections:
    found += [[lane.type, lane.boundary_line.tolist()] for lane in section.lanes if int(lane.id) != 0]
json.dump(found, sys.stdout)
"""

_AD_MAP = """
import json, sys
import ad_map_access as ad
text = open(sys.argv[1]).read()
kinds = ad.map.intersection.IntersectionType.TrafficLight, ad.map.landmark.TrafficLightType.SOLID_RED_YELLOW_GREEN
ad.map.access.initFromOpenDriveContent(text, 0.05, *kinds)
found = []
for number in ad.map.lane.getLanes():
    lane = ad.map.lane.getLane(number)
    for edge in (lane.edge_left, lane.edge_right):
        points = [[p.x.mECEFCoordinate, p.y.mECEFCoordinate, p.z.mECEFCoordinate] for p in edge.ecef_points]
        found.append([str(lane.type), points])
json.dump(found, open(sys.argv[2], "w"))
"""


@cache
def has(package: str) -> bool:
    """Return whether a package is there."""
    if not Path(PYTHON).exists():
        return False
    return subprocess.run([PYTHON, "-c", f"import {package}"], capture_output=True, check=False).returncode == 0


def quality(paths: list[Path]) -> dict[str, dict[str, tuple[str, list[str]]]]:
    """Return by file and check its status and its issues, as `asam-qc-opendrive` finds them."""
    return _run(_CHECK, *paths)


def pyxodr_borders(path: Path, resolution: float) -> list[tuple[str, Any]]:
    """Return type and outer border (N, 3) of every lane of every section as `pyxodr` reads them."""
    return _run(_PYXODR, path, resolution)


def ad_map_edges(path: Path, output: Path) -> list[tuple[str, Any]]:
    """Return type and edges (N, 3), geocentric, of every lane as `ad-map-access` reads them."""
    subprocess.run([PYTHON, "-c", _AD_MAP, str(path), str(output)], capture_output=True, check=True)
    return json.loads(output.read_text())


def _run(code: str, *arguments: object) -> Any:
    texts = [str(argument) for argument in arguments]
    done = subprocess.run([PYTHON, "-c", code, *texts], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)
