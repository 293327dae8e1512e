"""The result of a calibration as a picture: real and expected intensities of each class, and the fall-off with the
incidence angle. Drawn with Pillow alone, so that it looks the same in Blender."""

import io
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..base.arrays import Float
from ..base.errors import InputError
from ..base.files import write_file
from ..cloud.tools.diagram import (
    INK,
    LINES,
    SCALE,
    SOFT,
    Color,
    PlotFrame,
    draw_grid,
    draw_levels,
    draw_picture,
    draw_text,
)
from ..cloud.tools.picture import nice_step
from ..materials.surfaces import brightness_of, surfaces_of
from .fit import FITTED
from .job import Calibration, ClassComparison

_REAL, _REAL_EDGE = (203, 210, 219), (140, 150, 164)
"""Red, green, blue of the real cloud's bars and their outlines."""
_WIDTH, _PANEL, _MARGIN = 1200, 250, 16
"""Sizes in pixels. Chosen: fit a page."""
_BINS = 70
"""Bars of a histogram. Chosen: some pixels each."""
_ANGLES = np.linspace(0.0, 89.5, 180)
"""Incidence angles of curves, deg. Chosen: smooth at that width; at 90 nothing comes back."""


def save_plot(result: Calibration, path: Path, overwrite: bool = False) -> None:
    """Draw a calibration's result and write it as PNG.

    Raises:
        InputError: the name doesn't end in ``.png``, or the file is there already or can't be written.
    """
    if path.suffix.lower() != ".png":
        raise InputError("--plot", str(path), "must end in .png")
    data = io.BytesIO()
    calibration_picture(result).save(data, "PNG")
    write_file(path, data.getvalue(), "--plot", overwrite)


def calibration_picture(result: Calibration) -> Image.Image:
    """Return a picture of a calibration: a histogram for each class, and brightness by incidence angle below."""
    rows = len(result.compared) + 1

    def paint(draw: ImageDraw.ImageDraw) -> None:
        """Draw the title, the classes' histograms one below the other, and the fall-off last."""
        draw_text(draw, (_MARGIN, _MARGIN), _title(result), 19)
        least_intensity, largest_intensity = _limits(result)
        for number, entry in enumerate(result.compared):
            top = 2 * _MARGIN + 30 + number * (_PANEL + 54)
            _draw_class(draw, top, entry, (least_intensity, largest_intensity), LINES[number % len(LINES)])
        _draw_fall_off(draw, 2 * _MARGIN + 30 + (rows - 1) * (_PANEL + 54), result)

    return draw_picture((_WIDTH, rows * (_PANEL + 54) + 3 * _MARGIN + 40), paint)


def _title(result: Calibration) -> str:
    """Return the picture's title: the cloud, whether materials were fitted, and the gain."""
    job = result.job
    if job.real is None:
        return "Expected intensities (an ideal white target struck at a right angle at 1 m: 1)"
    subject = "fitted materials" if job.fit else "materials as they are"
    return f"{job.real.name}: {subject}, one gain of {result.gain:.4g} for all classes"


def _limits(result: Calibration) -> tuple[float, float]:
    """Return the least and the largest intensity of all classes' diagrams, outliers left out, with a margin."""
    values = [entry.expected for entry in result.compared]
    values += [entry.real.intensity for entry in result.compared if entry.real is not None]
    extremes = np.array([np.quantile(part, (0.002, 0.998)) for part in values])
    least_intensity, largest_intensity = float(extremes[:, 0].min()), float(extremes[:, 1].max())
    margin = max(0.03 * (largest_intensity - least_intensity), 1e-9 * max(abs(largest_intensity), 1e-9), 1e-12)
    return least_intensity - margin, largest_intensity + margin


def _draw_class(
    draw: ImageDraw.ImageDraw, top: float, entry: ClassComparison, limits: tuple[float, float], color: Color
) -> None:
    """Draw the histograms of a class's expected and real intensities, with marks at the `FITTED` quantiles.

    Args:
        draw: where to.
        top: of the panel, px.
        entry: the class.
        limits: least and largest intensity.
        color: of what is expected.
    """
    edges = np.linspace(*limits, _BINS + 1)
    expected_density = _density(entry.expected, edges)
    real_density = None if entry.real is None else _density(entry.real.intensity, edges)
    peak = 1.12 * max(float(expected_density.max()), 0.0 if real_density is None else float(real_density.max()))
    frame = _frame(draw, top, (limits[0], 0.0), (limits[1], peak))
    draw_grid(frame, "intensity")
    if real_density is not None and entry.real is not None:
        draw.polygon(_steps(frame, edges, real_density), fill=_REAL, outline=_REAL_EDGE)
        _draw_marks(frame, np.quantile(entry.real.intensity, FITTED), INK, 0.0)
    draw.line(_steps(frame, edges, expected_density)[1:-1], fill=color, width=2 * SCALE, joint="curve")
    _draw_marks(frame, np.quantile(entry.expected, FITTED), color, 1.0)
    draw_text(draw, (_MARGIN, top), entry.target.material, 17)
    for number, line in enumerate(_words(entry)):
        draw_text(draw, (_MARGIN, top + 28 + 19 * number), line, 13, SOFT if number else color)


def _words(entry: ClassComparison) -> list[str]:
    """Return the lines of text beside a class's diagram."""
    row = entry.after
    lines = ["expected (line)", f"reflectivity {row.reflectivity:.3f}"]
    if row.retroreflection:
        lines.append(f"retro-reflection {row.retroreflection:.3g}")
    if row.spread_below or row.spread_above:
        lines.append(f"spread {row.spread_below:.3f} / {row.spread_above:.3f}, {row.spread_wavelength:g} m")
    errors = entry.errors()
    if entry.real is not None and errors is not None:
        lines += ["", f"real (grey): {len(entry.real.intensity):,} points", f"{entry.real.zeros:,} zeros left out"]
        lines += ["", "error / interquartile range"]
        error_texts = (f"{100 * q:.0f}th: {100 * error:+.1f} %" for q, error in zip(FITTED, errors, strict=True))
        lines += [f"  {text}" for text in error_texts]
    return lines


def _draw_fall_off(draw: ImageDraw.ImageDraw, top: float, result: Calibration) -> None:
    """Draw each material's mean brightness by incidence angle, by the scan's reflection model."""
    rows = [entry.after for entry in result.compared]
    surfaces = surfaces_of(rows, result.job.reflection, spread=False)
    cosine, first_index = np.cos(np.deg2rad(_ANGLES)), np.zeros(len(_ANGLES), dtype=np.intp)
    curves = [brightness_of(surfaces, first_index + number, cosine) for number in range(len(rows))]
    frame = _frame(draw, top, (0.0, 0.0), (90.0, 1.12 * max(float(curve.max()) for curve in curves)))
    draw_grid(frame, "incidence angle, degrees")
    draw_levels(frame, nice_step(frame.high[1] / 3.0))
    draw_text(draw, (_MARGIN, top), "brightness", 17)
    model = {"lambert": "Lambert", "oren_nayar": "Oren and Nayar"}[result.job.reflection]
    for number, line in enumerate(("a white target struck", "at a right angle: 1", model)):
        draw_text(draw, (_MARGIN, top + 28 + 19 * number), line, 13, SOFT)
    for number, (curve, entry) in enumerate(zip(curves, result.compared, strict=True)):
        color = LINES[number % len(LINES)]
        draw.line(frame.at(_ANGLES, curve), fill=color, width=2 * SCALE)
        draw_text(draw, (_MARGIN, top + 104 + 19 * number), entry.target.material, 13, color)


def _density(values: Float, edges: Float) -> Float:
    """Return the share (B,) of values (N,) in each bin between edges (B + 1,)."""
    count, _ = np.histogram(values, bins=edges)
    return np.asarray(count / len(values))


def _frame(
    draw: ImageDraw.ImageDraw, top: float, low_end: tuple[float, float], high_end: tuple[float, float]
) -> PlotFrame:
    """Return the frame of a diagram.

    Args:
        draw: where to.
        top: of the panel, px.
        low_end, high_end: x and y at the lower left corner and at the upper right one.
    """
    box = (265.0 * SCALE, top * SCALE, (_WIDTH - _MARGIN) * SCALE, (top + _PANEL) * SCALE)
    return PlotFrame(draw, box, low_end, high_end)


def _steps(frame: PlotFrame, edges: Float, values: Float) -> list[tuple[float, float]]:
    """Return the pixels of a histogram's outline, from the axis up and back to it."""
    x, y = np.repeat(edges, 2), np.concatenate([[0.0], np.repeat(values, 2), [0.0]])
    return frame.at(x, y)


def _draw_marks(frame: PlotFrame, quantiles: Float, color: Color, row: float) -> None:
    """Draw short bars on the axis at quantiles; those with ``row`` 1 stand above those with 0."""
    bar_bottom, bar_top = 0.03 * (frame.high[1]) * row, 0.03 * frame.high[1] * (row + 1.0)
    for value in quantiles:
        frame.draw.line(
            frame.at(np.array([value, value]), np.array([bar_bottom, bar_top])), fill=color, width=3 * SCALE
        )
