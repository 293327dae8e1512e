"""OpenDRIVE, judged by ASAM's checker and by two readers."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from synthroads_addon.road.geometry import RoadGeometry
from tests.judges.samples import Samples

NOT_APPLICABLE = "check_asam_xodr_junctions_connection_one_connection_element"
"""The one of ASAM's 23 checks that says of itself that it isn't for OpenDRIVE 1.8."""
CHECKS = 23
_MILLIMETRE = 1e-3
_RESOLUTION = 0.02
"""Distance (m) at which pyxodr samples: it wants some in the shortest section, which is 5 cm long."""
_STEP = 0.05
"""Length (m) over which the road changes what it changes at once."""


# --- ASAM's checker -----------------------------------------------------------------------------------------------


def quality(path: Path) -> dict[str, tuple[str, list[str]]]:
    """Return each check's status and issues."""
    from qc_baselib import Configuration, Result
    from qc_opendrive import constants
    from qc_opendrive.main import run_checks

    config, result = Configuration(), Result()
    config.set_config_param("InputFile", str(path))
    result.register_checker_bundle(name=constants.BUNDLE_NAME, description="", version="1", summary="")
    result.set_result_version(version="1")
    run_checks(config, result)
    (bundle,) = result._report_results.checker_bundles
    return {item.checker_id: (item.status.value, [i.description for i in item.issues]) for item in bundle.checkers}


def quality_faults(path: Path) -> list[str]:
    """Return what the checker finds in a file, and what it left out that it shouldn't."""
    checks = quality(path)
    found = [] if len(checks) == CHECKS else [f"{len(checks)} checks and not {CHECKS}"]
    for name, (status, issues) in checks.items():
        found += [f"{name}: {issue}" for issue in issues]
        if status != ("skipped" if name == NOT_APPLICABLE else "completed"):
            found.append(f"{name}: {status}")
    return found


def quality_verdict(samples: Samples) -> list[str]:
    """Return what the checker finds."""
    return quality_faults(samples.file("twin.xodr"))


def with_a_wrong_spiral(samples: Samples) -> Samples:
    """Return files with an OpenDRIVE file whose spiral ends in another curvature than the line behind it begins."""
    wrong = re.sub(r'curvEnd="[^"]*"', 'curvEnd="0.004"', _text(samples), count=1)
    return samples.with_file("twin.xodr", wrong.encode())


def with_a_wide_lane(samples: Samples) -> Samples:
    """Return files with an OpenDRIVE file in which one lane is 10 cm wider."""
    (width,) = re.findall(r'type="driving".*?(<width sOffset="0" a="[^"]*")', _text(samples), re.DOTALL)[:1]
    number = float(width.split('"')[3])
    return samples.with_text("twin.xodr", width, f'<width sOffset="0" a="{number + 0.1}"')


def _text(samples: Samples) -> str:
    return samples.text("twin.xodr")


# --- readers ------------------------------------------------------------------------------------------------------


def pyxodr_borders(path: Path, resolution: float) -> list[np.ndarray]:
    """Return the outer border (N, 3) of every lane of every section as pyxodr reads it."""
    from pyxodr.road_objects.network import RoadNetwork

    roads = RoadNetwork(str(path), resolution=resolution).get_roads()
    sections = [section for road in roads for section in road.lane_sections]
    return [lane.boundary_line for section in sections for lane in section.lanes if int(lane.id) != 0]


def pyxodr_verdict(samples: Samples) -> list[str]:
    """Return the borders that pyxodr finds elsewhere: it reads local coordinates, without the header's offset."""
    borders = pyxodr_borders(samples.file("twin.xodr"), _RESOLUTION)
    # It samples at its own resolution: where a border runs obliquely that is as far off as it moves on.
    return _away(samples, borders, tilted_offsets, _RESOLUTION, _MILLIMETRE)


def ad_map_edges(path: Path) -> list[np.ndarray]:
    """Return the edges (N, 3), geocentric, of every lane as ad-map-access reads them, in a process of its own."""
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("ad_map_reader.py")), str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    return [np.array(points) for points in json.loads(done.stdout.splitlines()[-1])]


def ad_map_verdict(samples: Samples) -> list[str]:
    """Return the edges that ad-map-access finds elsewhere.

    It leaves the header's offset out, so its points lie around the origin of the map's coordinate system.
    """
    from pyproj import Proj, Transformer

    to_geographic = Transformer.from_crs(4978, 4979, always_xy=True)
    to_map = Proj(samples.road.metadata.epsg)
    edges = []
    for points in ad_map_edges(samples.file("twin.xodr")):
        longitude, latitude, height = to_geographic.transform(*points.T)
        edges.append(np.column_stack([*to_map(longitude, latitude), height]))
    # Along tapers borders are as far beside ours as their places are along the road, which climbs.
    return _away(samples, edges, tilted_back_offsets, 0.0, 5.0 * _MILLIMETRE)


def _away(
    samples: Samples,
    lines: Iterable[np.ndarray],
    offsets: Callable[[RoadGeometry, np.ndarray], np.ndarray],
    resolution: float,
    limit: float,
) -> list[str]:
    """Return the lines (N, 3) of which a point lies off all boundaries, at ``offsets``, by more than a limit (m).

    Where boundaries run obliquely they may be off by what they move on within the reader's resolution (m).
    """
    geometry, found, count = samples.geometry, [], 0
    for number, points in enumerate(lines):
        count += 1
        s, t = geometry.alignment.project(points[:, :2])
        inside = (s > resolution + 0.01) & (s < geometry.length - resolution - 0.01)
        s, t = s[inside], t[inside]
        known = offsets(geometry, s)
        away = np.abs(known - t[:, None]).min(axis=1, initial=np.inf)
        moved = _moved(samples, s, max(resolution, _STEP))
        off = (away > limit + (moved if resolution else 0.0)) & ~(moved > 0.1)
        if off.any():
            worst = np.argmax(np.where(off, away, 0.0))
            found.append(f"line {number} is {away[worst]:.4f} m off at {s[worst]:.2f} m")
    return found if count > 50 else [*found, f"{count} lines only"]


def tilted_offsets(geometry: RoadGeometry, s: np.ndarray) -> np.ndarray:
    """Return t (N, B) of the strips' boundaries at stations (N,), in the planes of all carriageways.

    Readers that don't tilt the road take that for an offset in plan.
    """
    return np.hstack([t for t, _ in _in_planes(geometry, s)])


def tilted_back_offsets(geometry: RoadGeometry, s: np.ndarray) -> np.ndarray:
    """Return the offsets (N, B) at which readers that tilt the road, and know no height of a lane, see boundaries."""
    return np.hstack([t * np.cos(tilt) for t, tilt in _in_planes(geometry, s)])


def _in_planes(geometry: RoadGeometry, s: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return t (N, B) of all boundaries in each carriageway's plane, and how that is tilted (N, 1), rad."""
    offsets, levels = geometry.offsets(s), geometry.boundary_elevations(s)
    found = []
    for section in geometry.sections.values():
        rise = geometry.crossfall(section.carriageway, s)
        line = geometry.profile.elevation(s) - rise * section.carriageway.sign * section.pivot(s)
        tilt = np.arctan(rise)[:, None]
        found.append((offsets * np.cos(tilt) + (levels - line[:, None]) * np.sin(tilt), tilt))
    return found


def _moved(samples: Samples, s: np.ndarray, reach: float) -> np.ndarray:
    """Return how far (m) boundaries move at most between a reach (m) before and behind stations (N,)."""
    geometry = samples.geometry
    return np.abs(geometry.offsets(s + reach) - geometry.offsets(s - reach)).max(axis=1, initial=0.0)
