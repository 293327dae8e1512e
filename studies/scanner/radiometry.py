"""Pictures and tables of beam, reflection and weather for the documentation.

python studies/scanner/radiometry.py --output docs/pictures
python studies/scanner/radiometry.py --tables
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.patches import Circle

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.materials.reflectance import facet_terms, returned_share  # noqa: E402
from synthroads_addon.materials.table import Material, materials  # noqa: E402
from synthroads_addon.materials.variation import vary_material  # noqa: E402
from synthroads_addon.road.surroundings import Environment, MaterialVariation  # noqa: E402
from synthroads_addon.scanning.beam import RINGS, beam_pattern, conical_directions, cylindrical_offsets  # noqa: E402
from synthroads_addon.scanning.weather.base import Weather  # noqa: E402
from synthroads_addon.scanning.weather.conditions import (  # noqa: E402
    Clear,
    Dust,
    Fog,
    Haze,
    Precipitation,
    Rain,
    Snow,
)
from synthroads_addon.scanning.weather.extinction import (  # noqa: E402
    kim_exponent,
    kruse_exponent,
    visibility_extinction,
)
from synthroads_addon.scanning.weather.registry import WEATHERS  # noqa: E402

BLUE, ORANGE, GREEN, RED, VIOLET, GREY = "#2a6f97", "#d9822b", "#4a8c4a", "#b3413a", "#7a5195", "#6b6b6b"
CONDITIONS: list[tuple[str, Weather, str]] = [
    ("clear, 23 km", Clear(), BLUE),
    ("rain, 7 km", Rain(), "#58a4b0"),
    ("haze, 4 km", Haze(), GREEN),
    ("dust, 2 km", Dust(), ORANGE),
    ("rain, 25 mm/h", Rain(rate_mm_h=25), "#1b4965"),
    ("snow, 1.5 km", Snow(), VIOLET),
    ("snow, 5 mm/h", Snow(rate_mm_h=5), "#a05195"),
    ("fog, 400 m", Fog(), GREY),
    ("fog, 100 m", Fog(visibility=100), "#222222"),
]
_SPECIES = ("birch", "poplar", "pine", "hawthorn", "hazel", "blackthorn")
_ALIKE = {*(f"{species}_leaves" for species in _SPECIES), "meadow", "ryegrass", "reed"}
"""Plants that the table leaves out: they are as leaves of maple, of shrubs, as needles or grass."""
ANGLES = np.linspace(0.0, 89.9, 400)


def main() -> None:
    """Write the pictures or print the tables, as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, help="folder of the pictures")
    parser.add_argument("--tables", action="store_true", help="print the tables of docs/radiometry.md")
    arguments = parser.parse_args()
    mpl.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    if arguments.output:
        arguments.output.mkdir(parents=True, exist_ok=True)
        for name, draw in FIGURES.items():
            figure = draw()
            save_figure(figure, arguments.output / f"{name}.png", dpi=130)
    if arguments.tables:
        print_tables()


def beam_patterns() -> Any:
    """Return a figure of the beam patterns' rays across the beam, and of a conical and a cylindrical beam on a step."""
    figure = new_figure(10.5, 6.4)
    upper_part, lower_part = figure.subfigures(2, 1, height_ratios=[1.0, 1.35])
    rings_of_rays = {rays: rings for rays, rings in RINGS.items() if rays > 1} | {21: (10, 10)}
    for axes, (rays, rings) in zip(upper_part.subplots(1, len(rings_of_rays)), rings_of_rays.items(), strict=True):
        _pattern(axes, rings)
        axes.set_title(f"{rays} rays: 1 + {' + '.join(map(str, rings))}", fontsize=9)
    upper_part.suptitle("Rays across the beam; area: share of energy; circle: 1/e² of the peak", fontsize=10)
    sides = lower_part.subplots(1, 2, sharey=True)
    for axes, beam in zip(sides, ("conical", "cylindrical"), strict=True):
        _step(axes, beam)
        axes.set_title(f"{beam}, at a step 40 and 60 m below the scanner", fontsize=10)
    sides[0].set_ylabel("height (m)")
    return figure


def _pattern(axes: Any, rings: tuple[int, ...]) -> None:
    """Draw a beam pattern's rays on its energy into the axes."""
    pattern = beam_pattern(rings)
    grid = np.linspace(-2.6, 2.6, 200)
    energy = np.exp(-2.0 * (grid[:, None] ** 2 + grid**2))
    extent = (grid[0], grid[-1], grid[0], grid[-1])
    axes.imshow(energy**0.5, extent=extent, cmap="Reds", vmin=0, vmax=1.6, origin="lower")
    axes.add_patch(Circle((0, 0), 1.0, fill=False, color=GREY, linewidth=0.8, linestyle="--"))
    size = np.maximum(700.0 * pattern.weights, 1.5)
    axes.scatter(*pattern.across.T, s=size, color=BLUE, alpha=0.85, linewidths=0)
    axes.set(xlim=(-2.6, 2.6), ylim=(-2.6, 2.6), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set_visible(False)


def _step(axes: Any, beam: str) -> None:
    """Draw one pulse's rays, 150 mrad wide, from 60 m above the ground beside a roof at 20 m, into the axes."""
    divergence, height, roof = (0.15, 0.15), 60.0, 20.0
    east, north, up = (np.eye(3)[axis][:, None] for axis in range(3))
    downward = -up
    pattern = beam_pattern((6, 12))
    origin = np.zeros((3, len(pattern)))
    direction = np.repeat(downward, len(pattern), axis=1)
    if beam == "conical":
        direction = conical_directions(downward, east, north, pattern, divergence)[..., 0]
    else:
        origin = cylindrical_offsets(east, north, pattern, divergence, np.array([height - roof]))[..., 0]
    edge = 0.9
    slope = direction[0] / -direction[2]
    on_roof = origin[0] + slope * (height - roof) < edge
    reach = np.where(on_roof, height - roof, height)
    ends = origin[0] + slope * reach
    axes.fill_between([-9, edge, edge, 9], [roof, roof, 0, 0], -4, color="#d8d4cc", linewidth=0)
    for start, end, length, is_on_roof in zip(origin[0], ends, reach, on_roof, strict=True):
        color = ORANGE if is_on_roof else BLUE
        axes.plot([start, end], [height, height - length], color=color, linewidth=0.7, alpha=0.8)
    axes.scatter(ends, height - reach, s=300 * pattern.weights, color=np.where(on_roof, ORANGE, BLUE), zorder=3)
    axes.scatter([0], [height], marker="v", s=60, color="black", zorder=4)
    for distance, level in ((height - roof, roof), (height, 0.0)):
        half_width = math.tan(divergence[0] / 2) * (distance if beam == "conical" else height - roof)
        axes.annotate(
            "", (-half_width, level - 1.6), (half_width, level - 1.6), arrowprops={"arrowstyle": "<->", "lw": 0.9}
        )
        axes.text(0, level - 2.4, f"{2 * half_width:.1f} m at 1/e²", ha="center", va="top", fontsize=8)
    axes.set(xlim=(-9, 9), ylim=(-7, 64), xlabel="across (m)")


def weather() -> Any:
    """Return a figure of the light left over the range by weather, and of the extinction over the visibility."""
    figure = new_figure(10.5, 4.4)
    left_axes, right_axes = figure.subplots(1, 2)
    ranges = np.linspace(0.0, 250.0, 300)
    for label, condition, color in CONDITIONS:
        returned_light = np.exp(-condition.attenuation(905.0) * ranges)
        left_axes.plot(ranges, 100 * returned_light, color=color, linewidth=1.6, label=label)
    left_axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
    left_axes.set(xlabel="range (m)", ylabel="light left, there and back (%)", ylim=(0, 102), xlim=(0, 250))
    left_axes.set_title("What is left of the light, 905 nm", fontsize=10)
    visibility = np.geomspace(50, 60_000, 400)
    for wavelength, color in ((905.0, BLUE), (1550.0, ORANGE)):
        for exponent, style, name in ((kim_exponent, "-", "Kim"), (kruse_exponent, "--", "Kruse")):
            values = [1e3 * visibility_extinction(v, wavelength, exponent(v)) for v in visibility]
            label = f"{name}, {wavelength:.0f} nm"
            right_axes.loglog(visibility / 1e3, values, style, color=color, linewidth=1.4, label=label)
    drops = [1e3 * visibility_extinction(v, 905.0, 0.0) for v in visibility]
    right_axes.loglog(visibility / 1e3, drops, ":", color=GREY, linewidth=1.4, label="fog, rain, snow")
    right_axes.legend(frameon=False, fontsize=8)
    right_axes.set(xlabel="visibility (km)", ylabel="extinction, one way (1/km)")
    right_axes.set_title("Extinction by visibility", fontsize=10)
    right_axes.grid(which="major", color="#e4e4e4", linewidth=0.6)
    return figure


def reflection_models() -> Any:
    """Return a figure of brightness over incidence angle, of Oren-Nayar facets and of the table's materials."""
    figure = new_figure(10.5, 4.4)
    left_axes, right_axes = figure.subplots(1, 2)
    cosine = np.cos(np.deg2rad(ANGLES))
    shades = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, 6))
    for slope, color in zip((0.0, 0.1, 0.2, 0.3, 0.5, 1.0), shades, strict=True):
        a, b = facet_terms(slope)
        label = "0 (Lambert)" if slope == 0.0 else f"{slope:g}"
        left_axes.plot(ANGLES, returned_share(cosine, 1.0, float(a), float(b)), color=color, linewidth=1.5, label=label)
    left_axes.legend(title="facet slope (rad)", frameon=False, fontsize=8)
    left_axes.set(xlabel="incidence angle (deg)", ylabel="brightness of R = 1", xlim=(0, 90), ylim=(0, 1.02))
    left_axes.set_title("Oren and Nayar", fontsize=10)
    for label, material, color, style in _shown_materials():
        right_axes.semilogy(ANGLES, _brightness(material, cosine), style, color=color, linewidth=1.5, label=label)
    right_axes.legend(frameon=False, fontsize=8, ncols=2, loc="lower left")
    right_axes.set(xlabel="incidence angle (deg)", ylabel="brightness", xlim=(0, 90), ylim=(3e-3, 1.5e3))
    right_axes.set_title("Materials, with facets and retro-reflection", fontsize=10)
    right_axes.grid(which="major", axis="y", color="#e4e4e4", linewidth=0.6)
    return figure


def _shown_materials() -> list[tuple[str, Material, str, str]]:
    """Return name, material, colour and line style of each material that is drawn."""
    table = materials()
    wet_paint = vary_material("paint_white", MaterialVariation(), Environment(wetness=1.0))
    worn_paint = vary_material("paint_white", MaterialVariation(paint_wear=0.8), Environment())
    return [
        ("reflector", table["reflector"], RED, "-"),
        ("white sheeting", table["sheeting_white"], ORANGE, "-"),
        ("blue sheeting", table["sheeting_blue"], BLUE, "-"),
        ("white paint", table["paint_white"], VIOLET, "-"),
        ("white paint, wet", wet_paint, VIOLET, "--"),
        ("white paint, 80 % worn", worn_paint, VIOLET, ":"),
        ("concrete", table["concrete"], GREEN, "-"),
        ("asphalt", table["asphalt"], GREY, "-"),
    ]


def _brightness(material: Material, cosine: Any) -> Any:
    """Return a material's brightness by the cosine of the incidence angle."""
    a, b = facet_terms(material.slope)
    lobe = 1.0 / math.radians(material.retro_lobe_deg) ** 2
    reflected_share = (1.0 - material.transmission) * material.reflectivity
    return returned_share(cosine, reflected_share, float(a), float(b), material.retroreflection, lobe)


def print_tables() -> None:
    """Print the tables of weathers' extinction and of materials' reflection as Markdown."""
    print("| weather | measure | extinction at 905 nm (1/km) | at 1550 nm | left over 50 m at 905 nm | over 100 m |")
    print("|---|---|---|---|---|---|")
    for condition, model in WEATHERS.items():
        _print_weather(model(condition=condition))
    _print_weather(Fog(visibility=100))
    for rate in (5, 25, 50):
        _print_weather(Rain(rate_mm_h=rate))
    for rate in (1, 5):
        _print_weather(Snow(rate_mm_h=rate))
    print()
    print("| material | R | facet slope (rad) | transmission | retro-reflection | lobe (deg) | 0° | 30° | 60° | 85° |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, row in materials().items():
        if name not in _ALIKE and (row.transmission or row.retroreflection or row.facet_slope is not None):
            _print_material(name, row)


def _print_weather(weather: Weather) -> None:
    """Print the row of a weather's extinction."""
    usual_visibility = weather.usual["visibility"] if weather.visibility is None else weather.visibility
    rate = weather.rate_mm_h if isinstance(weather, Precipitation) else None
    measure = f"{usual_visibility:,.0f} m" if rate is None else f"{rate:g} mm/h"
    attenuation = weather.attenuation(905.0)
    extinctions = [500.0 * weather.attenuation(wavelength) for wavelength in (905.0, 1550.0)]
    percents_left = [100.0 * math.exp(-attenuation * distance) for distance in (50.0, 100.0)]
    print(
        f"| {weather.condition} | {measure} | {extinctions[0]:.3g} | {extinctions[1]:.3g} "
        f"| {percents_left[0]:.3g} % | {percents_left[1]:.3g} % |"
    )


def _print_material(name: str, row: Material) -> None:
    """Print the row of a material's reflection."""
    brightness = _brightness(row, np.cos(np.deg2rad([0.0, 30.0, 60.0, 85.0])))
    lobe = f"{row.retro_lobe_deg:g}" if row.retroreflection else "–"
    print(
        f"| `{name}` | {row.reflectivity:.2f} | {row.slope:.2g} | {row.transmission or '–'} "
        f"| {row.retroreflection or '–'} | {lobe} | {' | '.join(f'{value:.3g}' for value in brightness)} |"
    )


FIGURES = {"beam-patterns": beam_patterns, "weather": weather, "reflection-models": reflection_models}

if __name__ == "__main__":
    main()
