"""Draw five kinds of change in model and cloud: a bent rail, a leaning post, a settlement, a new course and a rut.

Usage: python studies/surfaces/epochs.py [FILE]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import matplotlib as mpl  # noqa: E402

mpl.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs  # noqa: E402
from synthroads_addon.jobs.generate import Job  # noqa: E402
from synthroads_addon.road.changes.change import Change, read_changes  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.road.parameters import read_parameters  # noqa: E402
from synthroads_addon.scanning.epochs.truth import CODES  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402

LIMITS = '{"years": 5, "settlements": 1, "overlays": 1, "hits_per_km": {"minimum": 15, "maximum": 15}, '
LIMITS += '"settlement_depth": {"minimum": 0.03, "maximum": 0.04}, '
LIMITS += '"rut_growth": {"minimum": 0.002, "maximum": 0.002}, "kinds": ["rutted", "settled", "overlaid", "damaged"]}'
SETTINGS = [
    "road.length=160",
    "road.vehicles.per_km={\"minimum\":0,\"maximum\":0}",
    "seed=5",
    "fidelity=draft",
    "vegetation_detail=0",
    "colour.source=material",
    "colour.rgb=false",
    "scan.relief=0",
    'outputs=["parameters","cloud"]',
    'cloud.formats=["npz"]',
    f"road.changes={LIMITS}",
]
SHOWN = (("damaged", "bent"), ("damaged", "leaning"), ("settled", ""), ("overlaid", ""), ("rutted", ""))
TITLES = ("bent rail", "leaning post", "settlement", "new course", "ruts")
_TALL = 1.6
"""Height that is shown of things, m."""


def main(file: Path) -> None:
    """Make two epochs, and draw five of their changes."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "epochs"
        generate_epochs(EpochsJob(Job(load_scenario("mobile-mapping-300m", SETTINGS), output, new_file=True)))
        changes = read_changes(output / "epoch-2" / "changes.json").changes
        roads = [RoadGeometry(read_parameters(output / f"epoch-{n}" / "parameters.json")) for n in (1, 2)]
        clouds = [dict(np.load(output / f"epoch-{n}" / "cloud.npz")) for n in (1, 2)]
    figure, axes = plt.subplots(2, len(SHOWN), figsize=(15, 6), layout="constrained")
    for column, ((kind, detail), title) in enumerate(zip(SHOWN, TITLES, strict=True)):
        change = next(c for c in changes if c.kind == kind and c.detail == detail)
        _draw(axes[:, column], change, roads, clouds)
        axes[0, column].set_title(f"{title}, {change.size:g} {change.unit}")
    figure.savefig(file, dpi=90)


def _draw(axes: Any, change: Change, roads: list[RoadGeometry], clouds: list[dict[str, Any]]) -> None:
    """Draw the points of both epochs around a change as a section, and the second one's changes from above."""
    extent = change.extent
    middle = (extent.start_station + extent.end_station) / 2.0
    is_thing = change.kind == "damaged"
    offset = ((extent.low_offset or 0.0) + (extent.high_offset or 0.0)) / 2.0
    depth = (0.5 if change.detail == "leaning" else 1.0) if is_thing else 0.3
    for color, name, road, cloud in zip(("0.55", "C3"), ("first epoch", "second epoch"), roads, clouds, strict=True):
        place = cloud["xyz"] - np.array(road.parameters.transform.translate)
        s, o = road.alignment.project(place[:, :2])
        near = (np.abs(s - middle) < depth) & (np.abs(o - offset) < (1.2 if is_thing else 9.0))
        base = road.profile.elevation(s[near])
        axes[0].plot(o[near], place[near, 2] - base, ".", color=color, ms=1.5 if is_thing else 1, label=name)
    axes[0].set_xlabel("offset, m")
    axes[0].legend(fontsize=7, markerscale=5, loc="best")
    road, cloud = roads[1], clouds[1]
    s, o = road.alignment.project(cloud["xyz"][:, :2] - np.array(road.parameters.transform.translate[:2]))
    reach = max((extent.end_station - extent.start_station) / 2.0 + 3.0, 3.0)
    near = (np.abs(s - middle) < reach) & (np.abs(o - offset) < (2.0 if is_thing else 9.0))
    if change.extent.low_offset is None:
        near = (np.abs(s - middle) < reach) & (np.abs(o) < 15.0)
    distance = 1000.0 * cloud["change_distance"][near]
    limit = max(float(np.percentile(np.abs(distance), 99.5)), 1.0)
    order = np.argsort(cloud["change"][near] == CODES[change.kind])
    shown = axes[1].scatter(
        s[near][order], o[near][order], c=distance[order], s=0.6, cmap="coolwarm", vmin=-limit, vmax=limit
    )
    axes[1].set_xlabel("station, m")
    plt.colorbar(shown, ax=axes[1], label="change_distance, mm", shrink=0.8)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures" / "epochs.png")
