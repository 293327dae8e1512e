"""A calibration from its inputs to its result: expected intensities beside a real cloud's, and a fit if asked for.

`calibration_steps` yields the share that is done, so that the panel can show progress and stop it.
"""

from collections.abc import Generator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.arrays import Float
from ..base.errors import InputError, nearest_name
from ..base.machine import linear_algebra_on_one_thread
from ..base.progress import exhaust
from ..cloud.selection.classes import RealClass, RealCloud, class_by_label, ranges_and_incidences, read_real_cloud
from ..cloud.selection.patches import with_points_beside
from ..cloud.selection.pavement import RoadClasses, road_classes
from ..materials.surfaces import Reflection
from ..materials.table import Material, materials, read_material_table, write_material_table
from ..scanning.devices.device import DeviceChoice, ScannerSetting, load_device, setting_of
from .expected import (
    Expectation,
    ReceiverModel,
    Texture,
    Views,
    chosen_views,
    read_texture,
    receiver_of_device,
)
from .fit import (
    FITTED,
    SHOWN,
    Fit,
    apply_gain,
    brighten_material,
    common_gain,
    fit_level_and_spreads,
    fitted_slope,
    fitted_wavelength,
    interquartile_range,
)

Part = Literal["spread", "wavelength", "slope", "compression"]
PARTS: tuple[Part, ...] = ("spread", "wavelength", "slope", "compression")
"""Parts of a fit that a job may ask for."""
_ROAD = ("paved", "line")
"""Classes by place that `RoadClasses` tells."""
_MOST_VIEWS = 60
"""Views of a class in a report at most. Chosen: as many as a picture shows."""
_LEAST_CONTRAST = 1.2
"""Factor between the powers of classes from which on they tell a compression. Chosen: less is in their noise."""
_COMPRESSIONS = (0.05, 1.1)
"""Exponents of a compression that are believed. Chosen: roots are common; no device expands by much."""


@dataclass(frozen=True)
class MaterialTarget:
    """A material of the table and the class of the real cloud that it is compared with.

    Attributes:
        material: name in the table.
        real_class: number or name of a class in the cloud; ``paved`` or ``line`` beside an axis; None without a cloud.
        texture: image of it; None for the table's constants.
        texture_width: of the surface that the image shows, m.
    """

    material: str
    real_class: str | None = None
    texture: Path | Texture | None = None
    texture_width: float = 1.0


@dataclass(frozen=True)
class CalibrationJob:
    """Request for a calibration: what is compared with what, how it was seen, and what is fitted.

    Attributes:
        targets: materials with their classes; a strip's is compared after the one that lies beside it.
        table: the material table to begin with; None for the shipped one.
        scene: materials of a scene, in place of the table's of the same names.
        real: cloud to compare with; None for expected intensities alone.
        class_field: extra attribute of the cloud that holds the classes.
        road: where pavement and markings lie, for a cloud without labels.
        device: preset or file, for the beam's divergence; a ray without.
        incidence_deg, ranges: angles and ranges (m) at which places were seen, all combinations alike often.
        scanner: map coordinates of the one place that it was seen from, instead of angles and ranges.
        reflection: as in a scenario.
        attenuation: of the air, 1/m of range.
        range_corrected, decibels: see `ReceiverModel`.
        device_response: whether numbers are made as the device's file says, instead of these two.
        compression: of the numbers, in place of the device's; it is fitted if `parts` says so.
        fit: whether materials and gain are fitted; else only the gain is, if there is a cloud.
        parts: what is fitted besides the brightness.
        hold: material whose brightness stays as it is.
        gain: of the device, if it is known from another cloud; else it is free.
    """

    targets: tuple[MaterialTarget, ...]
    table: Path | None = None
    real: Path | None = None
    class_field: str | None = None
    road: RoadClasses | None = None
    device: str | None = None
    incidence_deg: tuple[float, ...] = (0.0,)
    ranges: tuple[float, ...] = (60.0,)
    scanner: tuple[float, float, float] | None = None
    reflection: Reflection = "lambert"
    attenuation: float = 0.0
    range_corrected: bool = False
    decibels: float | None = None
    device_response: bool = False
    compression: float | None = None
    fit: bool = True
    parts: frozenset[Part] = frozenset({"spread", "wavelength"})
    hold: str | None = None
    gain: float | None = None
    scene: Mapping[str, Material] = field(default_factory=dict)

    @property
    def receiver(self) -> ReceiverModel:
        """Return the response model of the job's device, a ray without divergence if none is named."""
        if self.device_response:
            model = receiver_of_device(self.setting, self.attenuation)
            return model if self.compression is None else replace(model, compression=self.compression)
        mrad = load_device(self.device).divergence_mrad if self.device else (0.0, 0.0)
        divergence = (mrad[0] * 1e-3, mrad[1] * 1e-3)
        compression = self.compression or 1.0
        return ReceiverModel(divergence, self.attenuation, self.range_corrected, self.decibels, compression)

    @property
    def setting(self) -> ScannerSetting:
        """Return the usual setting of the job's device.

        Raises:
            InputError: it names none.
        """
        if self.device is None:
            raise InputError("--device", None, "is needed for its response and for a device that is to be written")
        return setting_of(load_device(self.device), DeviceChoice())

    def initial_materials(self) -> dict[str, Material]:
        """Return the materials, by name, that the calibration starts from: shipped, the scene's, the user's table's."""
        return {**materials(), **self.scene, **(read_material_table(self.table) if self.table else {})}


@dataclass(frozen=True)
class ClassComparison:
    """Expected intensities of one material beside the real ones of its class.

    Attributes:
        target: the material and its class.
        before, after: the material; the same without a fit.
        expected: (`SAMPLES`,) intensities as the device would store them.
        incidence, distance: (`SAMPLES`,) rad and m, of these.
        real: the class; None without a cloud.
    """

    target: MaterialTarget
    before: Material
    after: Material
    expected: Float
    incidence: Float
    distance: Float
    real: RealClass | None

    def errors(self) -> Float | None:
        """Return the errors of the `FITTED` quantiles (4,) over the real interquartile range; None without a cloud."""
        if self.real is None:
            return None
        real_quantiles = np.quantile(self.real.intensity, FITTED)
        return np.asarray((np.quantile(self.expected, FITTED) - real_quantiles) / interquartile_range(real_quantiles))

    def to_dict(self) -> dict[str, Any]:
        """Return quantiles, errors, views and materials of the comparison as JSON data."""
        names = [f"{100 * share:g}" for share in SHOWN]

        def quantiles(values: Float) -> dict[str, float]:
            """Return the `SHOWN` quantiles of values, by name."""
            return {name: _short(value) for name, value in zip(names, np.quantile(values, SHOWN), strict=True)}

        data: dict[str, Any] = {"material": self.target.material, "expected": quantiles(self.expected)}
        errors = self.errors()
        if self.real is not None and errors is not None:
            data |= {
                "told_by": self.real.selection,
                "points": len(self.real.intensity),
                "zeros_left_out": self.real.zeros,
                "real": quantiles(self.real.intensity),
                "error_of_interquartile_range": {
                    f"{100 * share:g}": round(float(error), 4) for share, error in zip(FITTED, errors, strict=True)
                },
                "largest_error": round(float(np.abs(errors).max()), 4),
            }
        data["incidence_deg"] = [round(float(np.rad2deg(a)), 1) for a in np.quantile(self.incidence, (0.05, 0.5, 0.95))]
        data["views"] = self._by_view()
        data |= {"before": self.before.to_dict(), "after": self.after.to_dict()}
        return data | {"reflectivity": [_short(row.reflectivity) for row in (self.before, self.after)]}

    def _by_view(self) -> list[dict[str, float]]:
        """Return the expected quartiles at each incidence angle and range; empty if these are many."""
        views, owner = np.unique(np.stack([self.incidence, self.distance]), axis=1, return_inverse=True)
        if views.shape[1] > _MOST_VIEWS:
            return []
        rows = []
        for number, (angle, distance) in enumerate(views.T):
            lower_quartile, median, upper_quartile = np.quantile(
                self.expected[owner.ravel() == number], (0.25, 0.5, 0.75)
            )
            row = {
                "incidence_deg": np.rad2deg(angle),
                "range": distance,
                "25": lower_quartile,
                "50": median,
                "75": upper_quartile,
            }
            rows.append({name: _short(value) for name, value in row.items()})
        return rows


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration: gain, comparison of each class, and material table.

    Attributes:
        job: what was asked for.
        gain: the device's: stored intensities per linear one, or the factor before the decibels are taken.
        compared: in the order of the job.
        table: the table to begin with, with the fitted materials in it.
    """

    job: CalibrationJob
    gain: float
    compared: tuple[ClassComparison, ...]
    table: Mapping[str, Material] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return gain, settings and all classes' comparisons as JSON data."""
        job = self.job
        return {
            "type": "Calibration",
            "real": job.real.name if job.real else None,
            "fitted": bool(job.real and job.fit),
            "gain": _short(self.gain),
            "reflection": job.reflection,
            "device": job.device,
            "range_corrected": job.range_corrected,
            "decibels": job.decibels,
            "compression": None if job.compression is None else _short(job.compression),
            "classes": [entry.to_dict() for entry in self.compared],
        }


def calibrate(job: CalibrationJob) -> Calibration:
    """Run a calibration to its end, without progress, and return its result; see `calibration_steps`."""
    return exhaust(calibration_steps(job), lambda share: None)


def calibration_steps(job: CalibrationJob) -> Generator[float, None, Calibration]:
    """Run a calibration step by step: yield the share done, 0 to 1, and return the result.

    The classes share one gain. With a fit each takes the level that its quantiles need, and the gain is what they have
    in common, see `calibration.fit.common_gain`; without, it is the one with which the medians come nearest.

    Raises:
        InputError: an input is wrong, or the classes can't be explained by materials.
    """
    with linear_algebra_on_one_thread(scipy=True):
        return (yield from _calibration_steps(job))


def _calibration_steps(job: CalibrationJob) -> Generator[float, None, Calibration]:
    """Run a calibration step by step: see `calibration_steps`, which also keeps linear algebra to one thread."""
    check_job(job)
    table = job.initial_materials()
    yield 0.02
    real_classes = _real_classes(job)
    yield 0.4
    if "compression" in job.parts and job.fit and job.real is not None:
        job = replace(job, compression=_fitted_compression(job, table, real_classes))
    pairs = zip(job.targets, real_classes, strict=True)
    inputs = [_fit_input(job, target, table[target.material], points) for target, points in pairs]
    fits: list[Fit] = []
    for number, item in enumerate(inputs):
        side = _beside(job, inputs, fits, number)
        fits.append(_level(job, item, side))
        yield 0.4 + 0.5 * (number + 1) / len(inputs)
    yield 0.95
    return _result(job, table, inputs, fits)


def save_fitted(
    result: Calibration, path: Path, overwrite: bool = False, fitted_materials: Mapping[str, Material] | None = None
) -> None:
    """Write the fitted materials, with the others of the job's own table, to a material table file.

    Args:
        result: of the calibration.
        path: of the table.
        overwrite: replace a file that is there.
        fitted_materials: the fitted materials by name, if others than the result's.

    Raises:
        InputError: nothing was fitted, or the file can't be written, see `write_material_table`.
    """
    if result.job.real is None or not result.job.fit:
        raise InputError("--save", str(path), "needs a cloud that materials are fitted to")
    rows = dict(read_material_table(result.job.table)) if result.job.table else {}
    rows |= fitted_materials or {entry.target.material: entry.after for entry in result.compared}
    write_material_table(path, rows, overwrite)


def check_job(job: CalibrationJob) -> None:
    """Raise `InputError` if a job can't be done or contradicts itself, before any work."""
    table = job.initial_materials()
    if not job.targets:
        raise InputError("--material", None, "at least one is needed")
    for target in job.targets:
        if target.material not in table:
            hint = nearest_name(target.material, table)
            raise InputError("--material", target.material, f"must be a material of the table{hint}")
        if (target.real_class is None) != (job.real is None):
            raise InputError("--material", target.material, "needs its class with a cloud (NAME=CLASS), none without")
        if target.texture_width <= 0.0:
            raise InputError("--texture", target.texture_width, "the width that it shows must be above 0 m")
    names = [target.material for target in job.targets]
    if job.hold is not None and job.hold not in names:
        raise InputError("--hold", job.hold, f"must be one of {', '.join(names)}")
    if len(set(names)) < len(names):
        raise InputError("--material", names, "each material once")
    if job.gain is not None and (job.gain <= 0.0 or job.hold is not None):
        raise InputError("--gain", job.gain, "must be above 0, and can't be given together with --hold")
    _check_views(job)
    if job.road is not None:
        _check_road(job, job.road)
    _ = job.receiver


def _check_views(job: CalibrationJob) -> None:
    """Raise `InputError` if a job's response, angles, ranges or scanner are out of limits or contradict each other."""
    if job.device_response and (job.range_corrected or job.decibels is not None):
        raise InputError("--device-response", True, "can't be given with --range-corrected or --decibels")
    if not job.incidence_deg or not all(0.0 <= angle < 90.0 for angle in job.incidence_deg):
        raise InputError("--incidence-deg", list(job.incidence_deg), "must be 0 to below 90 degrees")
    if not job.ranges or not all(0.0 < distance <= 20_000.0 for distance in job.ranges):
        raise InputError("--range", list(job.ranges), "must be above 0, at most 20,000 m")
    if job.decibels is not None and not 1.0 <= job.decibels <= 200.0:
        raise InputError("--decibels", job.decibels, "must be 1 to 200 dB")
    if job.scanner is not None and job.real is None:
        raise InputError("--scanner", list(job.scanner), "needs a cloud")


def _check_road(job: CalibrationJob, road: RoadClasses) -> None:
    """Raise `InputError` if a job's classes beside an axis aren't told by the spans of pavement and lines."""
    for target in job.targets:
        if target.real_class not in _ROAD:
            assignment = f"{target.material}={target.real_class}"
            raise InputError("--material", assignment, "must be paved or line beside an axis")
    if any(begin >= end for begin, end in road.paved):
        raise InputError("--paved", [list(span) for span in road.paved], "must be FROM,TO, FROM being the smaller")
    class_names = {target.real_class for target in job.targets}
    for name, spans, option in (("paved", road.paved, "--paved"), ("line", road.lines, "--line")):
        if name in class_names and not spans:
            raise InputError(option, None, f"is needed to tell what is {name}")
    if not 0.02 <= road.line_width <= 2.0:
        raise InputError("--line-width", road.line_width, "must be 0.02 to 2 m")


def _fitted_compression(
    job: CalibrationJob, table: Mapping[str, Material], real_classes: list[RealClass | None]
) -> float:
    """Return the exponent with which the table's materials explain how far the classes' medians lie apart.

    Raises:
        InputError: there are fewer than two classes, they are as bright as each other, or no exponent explains them.
    """
    if len(job.targets) < 2 or job.decibels is not None:
        raise InputError("--fit", "compression", "needs two materials or more, and numbers that aren't decibels")
    linear_receiver = replace(job.receiver, compression=1.0)
    powers, numbers = [], []
    for target, points in zip(job.targets, real_classes, strict=True):
        assert points is not None
        expectation = Expectation(class_views(job, points), linear_receiver, job.reflection)
        powers.append(float(np.log(np.median(expectation.linear_intensities(table[target.material])))))
        numbers.append(float(np.log(np.median(points.intensity))))
    if np.ptp(powers) < np.log(_LEAST_CONTRAST):
        raise InputError("--fit", "compression", "needs materials whose brightness differs by a fifth")
    exponent = float(np.polyfit(powers, numbers, 1)[0])
    if not _COMPRESSIONS[0] <= exponent <= _COMPRESSIONS[1]:
        raise InputError(
            "--fit", round(exponent, 3), f"compression must be {_COMPRESSIONS[0]:g} to {_COMPRESSIONS[1]:g}"
        )
    return min(exponent, 1.0)


@dataclass(frozen=True)
class _FitInput:
    """Inputs of one class's fit.

    Attributes:
        target: the material and its class.
        before: the material of the table.
        material: that one with the texture's colour, and with facets and wavelength if these are fitted.
        expectation: simulated samples of the class.
        real: the class; None without a cloud.
        strip: whether the class is a strip.
    """

    target: MaterialTarget
    before: Material
    material: Material
    expectation: Expectation
    real: RealClass | None
    strip: bool


def _real_classes(job: CalibrationJob) -> list[RealClass | None]:
    """Return the points of each target's class; None for each without a cloud."""
    if job.real is None:
        return [None] * len(job.targets)
    cloud: RealCloud = read_real_cloud(job.real, job.class_field)
    if job.road is not None:
        classes = road_classes(cloud, job.road)
        points = [classes[str(target.real_class)] for target in job.targets]
    else:
        points = [
            class_by_label(cloud, str(target.real_class), f"--material {target.material}") for target in job.targets
        ]
    # A sensor is fitted to the first one's patches.
    return [with_points_beside(cloud, points[0]), *points[1:]]


def _fit_input(job: CalibrationJob, target: MaterialTarget, before: Material, real: RealClass | None) -> _FitInput:
    """Return the inputs of one class's fit.

    Args:
        job: the calibration.
        target: the material and its class.
        before: the material of the table.
        real: the class; None without a cloud.
    """
    material, texture, receiver = before, None, job.receiver
    if target.texture is not None:
        image = target.texture
        texture = image if isinstance(image, Texture) else read_texture(image, target.texture_width, before)
        material = before.model_copy(update={"base_color": texture.mean_color})
    views = class_views(job, real)
    if job.fit and real is not None:
        material = _with_facets(job, material, real, views)
    strip = job.road.line_width if job.road is not None and target.real_class == "line" else None
    expectation = Expectation(views, receiver, job.reflection, texture, strip)
    return _FitInput(target, before, material, expectation, real, strip is not None)


def _with_facets(job: CalibrationJob, material: Material, real: RealClass, views: Views) -> Material:
    """Return a material with the variation's wavelength and the facet slope fitted to a class, as far as the job asks.

    Args:
        job: the calibration.
        material: to begin with.
        real: the class.
        views: its incidence angles and ranges.
    """
    update: dict[str, Any] = {}
    if "wavelength" in job.parts:
        update["spread_wavelength"] = fitted_wavelength(real.place, real.intensity)
    scattering = job.reflection == "oren_nayar" and material.retroreflection == 0.0
    if "slope" in job.parts and scattering and len(views.incidence) == len(real.intensity):
        range_free_intensity = job.receiver.to_linear(real.intensity) * (
            1.0 if job.range_corrected else views.distance**2
        )
        slope = fitted_slope(views.incidence, range_free_intensity)
        update |= {} if slope is None else {"facet_slope": slope}
    return material.model_copy(update=update)


def class_views(job: CalibrationJob, real: RealClass | None) -> Views:
    """Return the incidence angles and ranges of a class: stored, computed from the scanner's place, or the job's."""
    if real is not None and job.scanner is not None:
        distance, incidence = ranges_and_incidences(real, np.array(job.scanner))
        return Views(incidence, distance)
    if real is not None and np.isfinite(real.distance).all() and np.isfinite(real.incidence).all():
        return Views(real.incidence, real.distance)
    return chosen_views(job.incidence_deg, job.ranges)


def _beside(
    job: CalibrationJob, inputs: list[_FitInput], fits: list[Fit], number: int
) -> tuple[Material, float] | None:
    """Return the material and level of the pavement beside a strip; None if the class is no strip.

    Args:
        job: the calibration.
        inputs: of all classes.
        fits: of the classes before this one, among which the pavement must be.
        number: of the class.
    """
    if not inputs[number].strip:
        return None
    for item, fit in zip(inputs, fits, strict=False):
        if item.target.real_class == "paved":
            return item.material, fit.level
    raise InputError("--material", inputs[number].target.material, "the material of the pavement must come before it")


def _level(job: CalibrationJob, item: _FitInput, side: tuple[Material, float] | None) -> Fit:
    """Return the fit of a class's level and spreads; without a cloud 1 and the material's own spreads."""
    if item.real is None:
        return Fit(1.0, item.material.spread_below, item.material.spread_above)
    quantiles = np.quantile(item.real.intensity, FITTED)
    with_spreads = job.fit and "spread" in job.parts
    return fit_level_and_spreads(item.expectation, item.material, quantiles, job.receiver, side, with_spreads)


def _result(
    job: CalibrationJob, table: Mapping[str, Material], inputs: list[_FitInput], fits: list[Fit]
) -> Calibration:
    """Return the calibration's result: the classes' common gain, their materials, and what these are expected to give.

    Args:
        job: the calibration.
        table: the materials to begin with.
        inputs: of all classes.
        fits: of these.
    """
    names = [item.target.material for item in inputs]
    rows = [item.material for item in inputs]
    hold = None if job.hold is None else names.index(job.hold)
    fitting = job.fit and job.real is not None
    gain = 1.0
    if job.real is not None:
        levels = [fit.level for fit in fits]
        gain = common_gain(rows, levels, hold, job.gain) if fitting else job.gain or _mean(levels)
    if fitting:
        rows = [
            brighten_material(row, fit.level / gain).model_copy(
                update={"spread_below": round(fit.below, 4), "spread_above": round(fit.above, 4)}
            )
            for row, fit in zip(rows, fits, strict=True)
        ]
        rows = [_round_material(row) for row in rows]
    compared = tuple(_compare_class(job, item, row, gain, rows, inputs) for item, row in zip(inputs, rows, strict=True))
    return Calibration(job, gain, compared, {**table, **dict(zip(names, rows, strict=True))} if fitting else table)


def _compare_class(
    job: CalibrationJob, item: _FitInput, row: Material, gain: float, rows: list[Material], inputs: list[_FitInput]
) -> ClassComparison:
    """Return the comparison of a class with the intensities that its final material and the gain give."""
    pairs = zip(rows, inputs, strict=True)
    side_material = next(
        (material for material, other_input in pairs if other_input.target.real_class == "paved"), None
    )
    fit = Fit(gain, row.spread_below, row.spread_above)
    expectation = item.expectation
    linear = apply_gain(
        expectation, row, fit, (side_material, gain) if item.strip and side_material is not None else None
    )
    return ClassComparison(
        item.target,
        item.before,
        row,
        job.receiver.to_stored(linear),
        expectation.incidence,
        expectation.distance,
        item.real,
    )


def _round_material(row: Material) -> Material:
    """Return a material rounded as a table holds it; raise `InputError` if it breaks the table's limits."""
    data = row.to_dict()
    for name in ("specular", "retroreflection", "facet_slope"):
        if name in data:
            data[name] = round(data[name], 5)
    data["base_color"] = [round(value, 5) for value in data["base_color"]]
    return Material.from_dict(data)


def _mean(levels: list[float]) -> float:
    """Return the geometric mean of levels."""
    return float(np.exp(np.mean(np.log(levels))))


def _short(value: float) -> float:
    """Return a number rounded to six significant digits."""
    return float(f"{value:.6g}")
