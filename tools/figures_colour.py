"""Time and errors of the points' colours by source, image spacing, ground sampling distance and samples.

    python tools/figures_colour.py --output out/colour

needs Blender 5.0 or newer as a Python package: a pixel per return is the truth. Writes ``colour.md`` (a table),
``colour.json`` and ``colour.png``. Times are processor seconds, so that they compare on a busy machine.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from synthroads_addon.core.colour import FROM_MATERIAL, MATERIAL_LAYERS, LayerSource, LayerValues, Targets

Float = NDArray[np.float64]

WANTED = frozenset({"rgb", *MATERIAL_LAYERS})
SPACINGS, DISTANCES = (15.0, 30.0, 60.0), (0.06, 0.12, 0.25, 0.5)
PATH_SAMPLES = (4, 16, 64)
TRUE_SAMPLES = 256
_LENGTH = 200.0
_ANGLE = np.deg2rad(60.0)
_WHITE = np.array([0.95047, 1.0, 1.08883])
_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


@dataclass(frozen=True)
class Row:
    """One way to colour the points.

    Attributes:
        source: how, as in a scenario.
        spacing, distance: of the images, m; 0 for none.
        samples: per pixel.
        megapixels: rendered.
        preparing: processor seconds before the first point.
        per_million: processor seconds per million returns after that.
        best, next_best, material: shares of the points by what gave them their values.
        colour_mean, colour_95: CIEDE2000 from the truth.
        layers: root mean square error of the base colour.
    """

    source: str
    lighting: str
    spacing: float
    distance: float
    samples: int
    images: int
    megapixels: float
    preparing: float
    per_million: float
    best: float
    next_best: float
    material: float
    colour_mean: float
    colour_95: float
    layers: float


def lab(rgb: NDArray[np.uint16]) -> Float:
    """Return CIE L*a*b* (N, 3) under D65 of 16-bit sRGB (N, 3)."""
    value = rgb.astype(np.float64) / 65535.0
    linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    ratio = linear @ _TO_XYZ.T / _WHITE
    f = np.where(ratio > (6 / 29) ** 3, np.cbrt(ratio), ratio * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def ciede2000(one: Float, other: Float) -> Float:
    """Return the colour differences (N,) of L*a*b* values (N, 3) by CIE 142-2001, in the form of Sharma et al. 2005."""
    (l1, a1, b1), (l2, a2, b2) = one.T, other.T
    mean_chroma = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2.0
    stretch = 1.5 - 0.5 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.degrees(np.arctan2(b1, a1)) % 360.0, np.degrees(np.arctan2(b2, a2)) % 360.0
    grey = c1 * c2 == 0.0
    turn = np.where(grey, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    # Opposite hues: the sign follows Sharma's convention, +180 where h2 > h1.
    turn = np.where((np.abs(turn) == 180.0) & (h2 > h1), 180.0, turn)
    apart = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2.0))
    lightness, chroma = (l1 + l2) / 2.0, (c1 + c2) / 2.0
    hue = np.where(np.abs(h1 - h2) <= 180.0, (h1 + h2) / 2.0, ((h1 + h2 + 360.0) / 2.0) % 360.0)
    hue = np.radians(np.where(grey, h1 + h2, hue))
    t = (
        1.0
        - 0.17 * np.cos(hue - np.radians(30.0))
        + 0.24 * np.cos(2.0 * hue)
        + 0.32 * np.cos(3.0 * hue + np.radians(6.0))
        - 0.20 * np.cos(4.0 * hue - np.radians(63.0))
    )
    s_l = 1.0 + 0.015 * (lightness - 50.0) ** 2 / np.sqrt(20.0 + (lightness - 50.0) ** 2)
    s_c, s_h = 1.0 + 0.045 * chroma, 1.0 + 0.015 * chroma * t
    rotation = 60.0 * np.exp(-(((np.degrees(hue) - 275.0) / 25.0) ** 2))
    r_t = -np.sin(np.radians(rotation)) * 2.0 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7))
    dl, dc, dh = (l2 - l1) / s_l, (c2 - c1) / s_c, apart / s_h
    return np.sqrt(dl * dl + dc * dc + dh * dh + r_t * dc * dh)


class Bench:
    """A stretch of motorway, returns from above, and the ways to colour them."""

    def __init__(self, count: int) -> None:
        from synthroads_addon.blender.files import empty_file
        from synthroads_addon.blender.model import build_road
        from synthroads_addon.blender.scene import scene_mesh
        from synthroads_addon.core.parameters.geometry import RoadGeometry
        from synthroads_addon.core.parameters.sampler import sample_road
        from synthroads_addon.core.scan_scenario import Platform
        from synthroads_addon.core.scanning.path import RoadGuide, make_path
        from synthroads_addon.core.scenario import load_scenario

        scenario = load_scenario("rq31-600m", [f"road.length={_LENGTH}"])
        self.parameters = sample_road(scenario.road, scenario.seed)
        empty_file()
        build_road(self.parameters, 0.005)
        self.mesh = scene_mesh()
        guide = RoadGuide(RoadGeometry(self.parameters))
        self.path = make_path(Platform(height=60.0, speed=8.0, lateral_offsets=(10.0, -10.0)), guide)
        self.points = self._returns(count)

    def _returns(self, count: int) -> Targets:
        """Return what random rays across the path hit, in the order of time."""
        from synthroads_addon.blender.casters import make_caster

        random = np.random.default_rng(1)
        rows = []
        for strip in self.path.strips:
            when = strip.start_time + np.sort(random.uniform(0.0, strip.duration, count // len(self.path.strips)))
            origin, rotation = self.path.pose(strip, when)
            angle = random.uniform(-_ANGLE, _ANGLE, len(when))
            body = np.stack([0.0 * angle, -np.sin(angle), -np.cos(angle)], axis=1)
            rows.append((when, origin, np.einsum("nij,nj->ni", rotation, body)))
        when, origin, along = (np.concatenate(parts) for parts in zip(*rows, strict=True))
        caster = make_caster("embree", self.mesh)
        face = caster.cast(origin.astype(np.float32), along.astype(np.float32), 500.0)
        hit = face >= 0
        when, origin, along, face = when[hit], origin[hit], along[hit], face[hit]
        corner = self.mesh.vertices[self.mesh.triangles[face]].astype(np.float64)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        facing = np.einsum("ni,ni->n", along, normal)
        reach = np.einsum("ni,ni->n", corner[:, 0] - origin, normal) / facing
        normal *= -np.sign(facing)[:, None]
        use = np.abs(facing) > 1e-3
        place = origin + reach[:, None] * along
        return Targets(place, origin, normal, self.mesh.material[face], when).select(use)

    def run(self, points: Targets, **scenario: Any) -> tuple[LayerValues, dict[str, Any]]:
        """Colour points; return their values and what it cost."""
        from synthroads_addon.blender.cameras import ColourJob, layer_source
        from synthroads_addon.core.colour_scenario import ColourScenario

        job = ColourJob(
            ColourScenario.from_dict(scenario),
            "standard",
            WANTED,
            self.mesh,
            self.parameters.environment,
            self.path,
            2.0 * _ANGLE,
        )
        start = time.process_time()
        with layer_source(job) as layers:
            # The first pixels bring the scene into the renderer.
            _sample(layers, points.select(slice(0, 64)))
            prepared = time.process_time()
            values = _sample(layers, points)
            done = time.process_time()
            report = getattr(layers, "report", {})
        return values, {
            "images": report.get("images", 0),
            "megapixels": report.get("pixels", 0) / 1e6,
            "preparing": prepared - start,
            "per_million": (done - prepared) / len(points) * 1e6,
        }


def _sample(layers: LayerSource, points: Targets) -> LayerValues:
    return layers.sample(points.position, points.scanner, points.normal, points.material, points.time, WANTED)


def rows(bench: Bench) -> Iterator[Row]:
    """Yield the rows of the table: direct lighting against a pixel per return, then whole light paths."""
    points = bench.points
    truth, cost = bench.run(points, source="returns")
    yield _row(truth, truth, cost, source="returns")
    values, cost = bench.run(points, source="material")
    yield _row(values, truth, cost, source="material")
    for spacing in SPACINGS:
        for distance in DISTANCES:
            setting = {"source": "images", "image_spacing": spacing, "ground_sampling_distance": distance}
            values, cost = bench.run(points, **setting)
            yield _row(values, truth, cost, source="images", spacing=spacing, distance=distance)
    few = points.select(slice(0, None, 10))
    truth, cost = bench.run(few, source="returns", lighting="path", samples=TRUE_SAMPLES)
    values, cost = bench.run(few, source="returns")
    yield _row(values, truth, cost, source="returns, against whole paths")
    for samples in PATH_SAMPLES:
        values, cost = bench.run(few, source="returns", lighting="path", samples=samples)
        yield _row(values, truth, cost, source="returns", lighting="path", samples=samples)


def _row(
    values: LayerValues,
    truth: LayerValues,
    cost: dict[str, Any],
    source: str,
    lighting: str = "direct",
    spacing: float = 0.0,
    distance: float = 0.0,
    samples: int = 1,
) -> Row:
    difference = ciede2000(lab(values.arrays["rgb"]), lab(truth.arrays["rgb"]))  # type: ignore[arg-type]
    apart = values.arrays["base_color"] - truth.arrays["base_color"]  # type: ignore[operator]
    return Row(
        source=source,
        lighting=lighting,
        spacing=spacing,
        distance=distance,
        samples=samples,
        **cost,
        best=float((values.source == 1).mean() + (values.source == 255).mean()),
        next_best=float(((values.source > 1) & (values.source < 255)).mean()),
        material=float((values.source == FROM_MATERIAL).mean()),
        colour_mean=float(difference.mean()),
        colour_95=float(np.percentile(difference, 95)),
        layers=float(np.sqrt((apart**2).mean())),
    )


def table(found: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    head = (
        "| source | lighting | spacing (m) | pixel (m) | samples | images | Mpx | before (s) | per million returns (s) "
        "| best image or own pixel (%) | next best (%) | material (%) | CIEDE2000 mean | 95 % | base colour RMSE |\n"
    )
    lines = [head, "|" + "---|" * 15 + "\n"]
    for row in found:
        size = f"{row.spacing:g} | {row.distance:g}" if row.spacing else "- | -"
        lines.append(
            f"| {row.source} | {row.lighting} | {size} | {row.samples} | {row.images} | {row.megapixels:.2f} "
            f"| {row.preparing:.1f} | {row.per_million:.2f} | {100 * row.best:.2f} | {100 * row.next_best:.2f} "
            f"| {100 * row.material:.2f} | {row.colour_mean:.2f} | {row.colour_95:.2f} | {row.layers:.4f} |\n"
        )
    return "".join(lines)


def plot(found: list[Row], path: Path) -> None:
    """Draw colour error against processor time of a million returns of the stretch, images and all."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    for spacing, marker in zip(SPACINGS, "osD", strict=True):
        own = [row for row in found if row.source == "images" and row.spacing == spacing]
        cost = [row.preparing + row.per_million for row in own]
        axes.plot(cost, [row.colour_mean for row in own], marker=marker, label=f"images every {spacing:g} m")
        for row, x in zip(own, cost, strict=True) if marker == "D" else ():
            name = f"{100 * row.distance:g} cm"
            axes.annotate(name, (x, row.colour_mean), (5, 6), textcoords="offset points", fontsize=8)
    for source, color in (("material", "0.4"), ("returns", "crimson")):
        row = next(row for row in found if row.source == source)
        name = "material's mean" if source == "material" else "a pixel per return (truth)"
        axes.plot(row.preparing + row.per_million, row.colour_mean, "*", color=color, markersize=13, label=name)
    axes.set_xscale("log")
    axes.set_xlabel(f"processor seconds for {_LENGTH:g} m of road and a million returns")
    axes.set_ylabel("mean colour difference CIEDE2000")
    axes.set_ylim(bottom=-0.2)
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=Path("out/colour"))
    parser.add_argument("--returns", type=int, default=500_000, help="rays that are cast")
    options = parser.parse_args()
    from synthroads_addon.blender.cameras import HAS_RETURN_CAMERA

    if not HAS_RETURN_CAMERA:
        parser.error("needs Blender 5.0 or newer, whose pixel per return is the truth")
    found = []
    for row in rows(Bench(options.returns)):
        found.append(row)
        print(table([row]).splitlines()[-1], flush=True)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "colour.md").write_text(table(found), encoding="utf-8")
    (options.output / "colour.json").write_text(json.dumps([asdict(row) for row in found], indent=1), encoding="utf-8")
    plot(found, options.output / "colour.png")


if __name__ == "__main__":
    main()
