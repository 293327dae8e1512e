"""Measure what settings cost and how large their errors are, on one scene per platform: the shipped table.

    python tools/make_tradeoff_prior.py [PLATFORM ...]

writes `synthroads_addon/presets/tradeoff_prior.json`, which choices by time fall back on (see docs/tradeoff.md); of the
platforms that aren't named it keeps what it holds. Seconds are those of processors: the whole job's on two cores, if
these share the scan and the images evenly. It needs a Blender that has a pixel per return, which the true colours are.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.schema import canonical_json, read_json  # noqa: E402
from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA, layer_source  # noqa: E402
from synthroads_addon.blender.files import empty_file, save_scene  # noqa: E402
from synthroads_addon.jobs.choose.knobs import colour_choices, model_knobs  # noqa: E402
from synthroads_addon.jobs.choose.table import FILE  # noqa: E402
from synthroads_addon.jobs.choose.trial import Trial  # noqa: E402
from synthroads_addon.jobs.measure.errors import beam_errors, shift_points  # noqa: E402
from synthroads_addon.jobs.open_scene import RoadScene  # noqa: E402
from synthroads_addon.road.geometry import RoadGeometry  # noqa: E402
from synthroads_addon.sampling.road import sample_road  # noqa: E402
from synthroads_addon.scanning.beam import RINGS  # noqa: E402
from synthroads_addon.scanning.colour.views import View  # noqa: E402
from synthroads_addon.scenario.scenario import load_scenario  # noqa: E402

SCENES: dict[str, tuple[str, Sequence[str]]] = {
    "uav": ("rq31-600m-even", ["road.length=300"]),
    "vehicle": ("mobile-mapping-300m-even", []),
    "tripod": ("tripod-200m-even", []),
    "airborne": ("airborne-1000m-even", []),
}
"""Platform -> scenario and changes."""
CORES = 2
OCTAVES = (2, 4, 6)
WANTED = frozenset({"rgb", "roughness", "metallic", "specular"})
SAMPLE = {"images": 0.7, "nodes": 2.4, "returns": 3.8}
"""Microseconds per point that takes its colour from images, from its material's nodes, and that is rendered by itself
(from images: `synthroads tradeoff`; the other two: the mean of `python studies/costs/layers.py`)."""
TIMED = 3
"""Images that are timed in full size; all but the first in a quarter of it as well."""
PREVIEWS = 0.1
"""Microseconds per point of the previews."""


def _short(value: float) -> float:
    """Return a number with three digits."""
    return float(f"{value:.3g}")


def _expected(errors: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Return the expected errors, the first of each pair, with three digits, by name."""
    return {name: _short(pair[0]) for name, pair in errors.items()}


def measure_platform(platform: str) -> dict[str, Any]:
    """Measure a platform's scene; return the table's row of costs (microseconds) and errors as JSON data."""
    name, changes = SCENES[platform]
    scenario = load_scenario(name, [*changes, "cloud.point_spacing=null"])
    empty_file()
    scene = RoadScene.of(scenario, RoadGeometry(sample_road(scenario.road, scenario.seed)))
    build_times, few_plants_points = [], None
    trial = None
    models = model_knobs(scenario, {})
    scene.rebuild(models[0].changes)  # untimed: the first build pays for what Blender loads once
    for model in models:
        begin = time.process_time()
        trial = Trial.of(scene.site, scene.rebuild(model.changes))
        trial.clock = time.process_time
        build_times.append(1e6 * (time.process_time() - begin) / scene.area)
        few_plants_points = few_plants_points or trial.points(RINGS[1])
    assert trial is not None
    assert few_plants_points is not None
    truth = trial.points()
    seconds = {rays: trial.time_scan(rings)[0] for rays, rings in RINGS.items()}
    colours = colour_choices(scenario, scene.site.path.typical_range, has_return_camera=False)
    sources = {key: _expected(pair) for key, pair in trial.colour_errors(colours, WANTED).items()}
    relief = {str(octaves): _short(errors["relief"][0]) for octaves, errors in trial.relief_errors(OCTAVES).items()}
    first_seconds, seconds_per_image, seconds_per_megapixel = image_seconds(trial, colours["standard"])
    return {
        "beam": {str(rays): _expected(beam_errors(trial.points(rings), truth)) for rays, rings in RINGS.items()},
        "few_plants": _expected(beam_errors(few_plants_points, truth)),
        "relief": relief,
        "colour": sources | {"returns": {"colour": 0.0, "layers": 0.0}},
        "pulse": {str(rays): _short(1e6 * value / trial.pulses / CORES) for rays, value in seconds.items()},
        "model": [_short(value) for value in build_times],
        "octave": {str(octaves): _short(octave_seconds(trial, octaves)) for octaves in OCTAVES},
        "image": [_short(first_seconds), _short(seconds_per_image / CORES), _short(seconds_per_megapixel / CORES)],
        "sample": SAMPLE,
        "scene_file": _short(_saving_time(scene.area)),
        "previews": PREVIEWS,
    }


def octave_seconds(trial: Trial, octaves: int) -> float:
    """Return the processor microseconds per point that the micro-relief takes with a number of octaves."""
    results = [result for result in trial.scan_lines(RINGS[1]) if len(result.points)]
    begin = trial.clock()
    places = shift_points(results, trial.plan, octaves)
    return 1e6 * (trial.clock() - begin) / max(1, sum(map(len, places)))


def image_seconds(trial: Trial, changes: Mapping[str, Any]) -> tuple[float, float, float]:
    """Render a few images; return processor seconds before the first, per image, and per megapixel (fitted)."""
    sizes: list[float] = []

    def pick(views: list[View]) -> list[View]:
        """Return views in the middles of equal parts of all, and all but the first of them in a quarter of the size."""
        middle_views = [views[len(views) * (2 * number + 1) // (2 * TIMED)] for number in range(TIMED)]
        small_views = [
            replace(view, size=(max(view.size[0] // 4, 1), max(view.size[1] // 4, 1))) for view in middle_views[1:]
        ]
        sizes.extend(view.pixels / 1e6 for view in [*middle_views, *small_views])
        return [*middle_views, *small_views]

    stamps = [trial.clock()]
    request = replace(trial.layer_request(changes), names=WANTED, pick=pick)
    with layer_source(request, progress=lambda share: stamps.append(trial.clock())):
        pass
    times = np.diff(stamps)
    table = np.stack([np.ones(len(sizes) - 1), np.array(sizes[1:])], axis=1)
    (seconds_per_image, seconds_per_megapixel), *_ = np.linalg.lstsq(table, times[1:], rcond=None)
    seconds_per_image, seconds_per_megapixel = (
        max(float(seconds_per_image), 0.0),
        max(float(seconds_per_megapixel), 0.0),
    )
    return (
        max(float(times[0]) - seconds_per_image - seconds_per_megapixel * sizes[0], 0.0),
        seconds_per_image,
        seconds_per_megapixel,
    )


def _saving_time(area: float) -> float:
    """Return the processor microseconds per square metre of `area` that saving the open file takes."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        save_scene(Path(folder) / "scene.blend")
        return 1e6 * (time.process_time() - begin) / area


def main() -> None:
    """Measure the command line's platforms and write the table after each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("platforms", nargs="*", metavar="PLATFORM", help=f"{', '.join(SCENES)}; without any, all")
    platforms = parser.parse_args().platforms or list(SCENES)
    if unknown_names := set(platforms) - set(SCENES):
        parser.error(f"no such platform: {', '.join(sorted(unknown_names))}; there are {', '.join(SCENES)}")
    if not HAS_RETURN_CAMERA:
        raise SystemExit("needs Blender 5.0 or newer: true colours are those of a pixel per return")
    rows = read_json(FILE)["platforms"] if FILE.exists() else {}
    for platform in platforms:
        rows[platform] = measure_platform(platform)
        data = {"command": "python tools/make_tradeoff_prior.py", "cores": CORES, "platforms": rows}
        FILE.write_text(canonical_json(data), encoding="utf-8")
        print(platform, round(time.process_time(), 1), "s")


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
