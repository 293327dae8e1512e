"""Draw five kinds of change in model and cloud: before, after, and the distance from the one to the other.

    python studies/changes/pictures.py --output docs/pictures

All five are planted on one road (`planted.py`), which a vehicle surveys before and after without errors of its
trajectory.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from studies.changes.planted import ONE_EACH, STATIONS, PlantedPair, planted_pair  # noqa: E402
from studies.changes.smallest import FAINTEST, sensor_scenario  # noqa: E402
from synthroads_addon.base.arrays import AnyArray, Float  # noqa: E402
from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.blender.files import empty_file  # noqa: E402
from synthroads_addon.blender.model.build import build_road  # noqa: E402
from synthroads_addon.blender.things.model_builder import BuildRequest  # noqa: E402
from synthroads_addon.blender.views import pictures  # noqa: E402
from synthroads_addon.blender.views.viewpoints import Viewpoint, place_on_road  # noqa: E402
from synthroads_addon.jobs.epochs.epochs import EpochsJob, generate_epochs  # noqa: E402
from synthroads_addon.jobs.generate import Job  # noqa: E402
from synthroads_addon.road.parameters import RoadParameters  # noqa: E402
from synthroads_addon.road.surroundings import Environment  # noqa: E402

NAME = "changes.png"
SIZE, SAMPLES = (480, 320), 10
"""Of each rendered picture: pixels, and samples."""
_DAYLIGHT = Environment(sun_azimuth_deg=215.0, sun_elevation_deg=42.0, cloud_cover=0.2)
_SENSOR = 36.0
"""Width of a camera's sensor that its lens is given for, mm."""
_TOLERANCE = 0.005


@dataclass(frozen=True)
class Row:
    """A change that is drawn in a row of the figure.

    Attributes:
        title: what happens.
        size: that is planted, in the series' unit.
        place: of its station among those of a road.
        eye, target: station from that of the change, offset and height of the camera and of what it looks at, m.
        scale: distance with the strongest colour, m; 0: the intensities' difference is drawn instead.
    """

    title: str
    size: float
    place: int
    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    scale: float


ROWS = {
    "overlaid": Row("new course, 40 mm", 0.04, 0, (-14.0, -6.0, 4.0), (0.0, -4.6, 0.0), 0.05),
    "bent": Row("rail bent by 0.6 m", 0.6, 1, (-8.0, -9.0, 2.2), (0.0, -14.7, 0.4), 0.5),
    "cut_back": Row("hedge cut from 2 to 1.2 m", 0.8, 2, (-9.0, -11.0, 2.6), (0.0, -18.0, 0.7), 0.8),
    "parked": Row("car parked", 1.0, 3, (-9.0, -8.0, 2.4), (0.0, -12.5, 0.5), 1.0),
    "turned": Row("sign turned by 45°", 45.0, 4, (-4.0, -12.5, 2.2), (0.0, -15.0, 1.9), 0.4),
}
"""Kind -> how it is drawn; one after the other along the road."""


def drawn_pair() -> PlantedPair:
    """Return the road before and after, each kind at a station of its own."""
    chosen = {series.kind: series for series in ONE_EACH}
    many = [
        replace(chosen[kind], sizes=(row.size,), shift=STATIONS[row.place] - STATIONS[0]) for kind, row in ROWS.items()
    ]
    return planted_pair("pictures", many)


def viewpoint(road: RoadParameters, row: Row) -> Viewpoint:
    """Return the camera of a row."""
    station = STATIONS[row.place]
    eye, target = (
        place_on_road(road, station + step, offset, height) for step, offset, height in (row.eye, row.target)
    )
    return Viewpoint(eye, target, 35.0)


def render_model(road: RoadParameters, folder: Path) -> dict[str, Any]:
    """Return a rendered picture of the model for each row, by its kind."""
    empty_file()
    build_road(BuildRequest(road, _TOLERANCE))
    pictures.light(_DAYLIGHT)
    result = {}
    for kind, row in ROWS.items():
        view = viewpoint(road, row)
        pictures.camera(view.place, view.target, view.lens)
        pictures.render(folder / "model.png", SIZE, SAMPLES)
        result[kind] = np.asarray(Image.open(folder / "model.png", formats=("PNG",)).convert("RGB"))
    return result


def project(view: Viewpoint, points: Float) -> tuple[Float, Float]:
    """Return the pixels (N, 2) of points (N, 3), m, in a camera, and their depths (N,), m; NaN behind it."""
    ahead = view.target - view.place
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    arm = points - view.place
    depth = arm @ ahead
    scale = SIZE[0] * view.lens / _SENSOR / np.where(depth > 0.5, depth, np.nan)
    down = np.cross(ahead, right)
    return np.column_stack([SIZE[0] / 2.0 + scale * (arm @ right), SIZE[1] / 2.0 + scale * (arm @ down)]), depth


def draw_cloud(axes: Any, view: Viewpoint, points: Float, values: Float, look: dict[str, Any]) -> None:
    """Draw points (N, 3), m, as a camera sees them, coloured by values (N,)."""
    pixel, depth = project(view, points)
    inside = np.flatnonzero(((pixel > -5.0) & (pixel < np.array(SIZE) + 5.0)).all(axis=1) & (depth < 60.0))
    rows = inside[np.argsort(-depth[inside])]
    size = np.clip(60.0 / depth[rows] ** 2, 0.15, 6.0)
    axes.scatter(*pixel[rows].T, s=size, c=values[rows], linewidths=0, rasterized=True, **look)
    axes.set(xlim=(0, SIZE[0]), ylim=(SIZE[1], 0), xticks=(), yticks=(), aspect="equal")
    axes.set_facecolor("#20242a")


def survey(pair: PlantedPair, folder: Path) -> list[dict[str, AnyArray]]:
    """Return the arrays of both epochs' clouds, by a vehicle; places are local."""
    parameters = folder / "before.json"
    parameters.write_text(pair.before.to_json(), encoding="utf-8")
    job = Job(sensor_scenario("mobile", "registered"), folder / "epochs", parameters=parameters, new_file=True)
    generate_epochs(EpochsJob(job, changes=(pair.changes,)))
    clouds = []
    for number in (1, 2):
        with np.load(folder / "epochs" / f"epoch-{number}" / "cloud.npz") as data:
            cloud = {name: data[name] for name in ("xyz", "intensity", "change", "change_distance")}
        cloud["xyz"] = cloud["xyz"] - np.array(pair.before.transform.translate)
        clouds.append(cloud)
    return clouds


def draw(pair: PlantedPair, models: list[dict[str, Any]], clouds: list[dict[str, AnyArray]]) -> Any:
    """Return the figure: a row for each kind, model and cloud before and after, and the cloud by its distance."""
    figure = new_figure(15.0, 10.6)
    grid = figure.subplots(len(ROWS), 5)
    titles = ("model before", "model after", "cloud before", "cloud after", "cloud after, by distance")
    for axes, title in zip(grid[0], titles, strict=True):
        axes.set_title(title)
    for lines, (kind, row) in zip(grid, ROWS.items(), strict=True):
        view = viewpoint(pair.before, row)
        for axes, model in zip(lines, models, strict=False):
            axes.imshow(model[kind])
            axes.set(xticks=(), yticks=())
        lines[0].set_ylabel(row.title)
        for axes, cloud in zip(lines[2:], clouds, strict=False):
            strength = np.log(np.maximum(cloud["intensity"], FAINTEST))
            low, high = np.quantile(strength, (0.02, 0.995))
            draw_cloud(axes, view, cloud["xyz"], strength, {"cmap": "gray", "vmin": low, "vmax": high})
        after = clouds[1]
        distance = np.where(after["change"] > 0, after["change_distance"], 0.0)
        look = {"cmap": "coolwarm", "vmin": -row.scale, "vmax": row.scale}
        draw_cloud(lines[4], view, after["xyz"], distance, look)
        figure.colorbar(lines[4].collections[0], ax=lines[4], label="m", shrink=0.9)
    return figure


def main() -> None:
    """Draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="folder of the picture")
    options = parser.parse_args()
    pair = drawn_pair()
    with tempfile.TemporaryDirectory() as folder:
        clouds = survey(pair, Path(folder))
        models = [render_model(road, Path(folder)) for road in (pair.before, pair.after)]
    options.output.mkdir(parents=True, exist_ok=True)
    save_figure(draw(pair, models, clouds), options.output / NAME, 100)
    sys.stdout.flush()
    os._exit(0)  # Blender may crash when Python unloads it


if __name__ == "__main__":
    main()
