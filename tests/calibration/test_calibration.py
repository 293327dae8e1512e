"""The calibration: expected intensities are the scan's, real classes are found, fits find what was put in."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from headless.cli import main
from synthroads_addon.base.arithmetic.noise import noise_field
from synthroads_addon.base.arrays import otsu_threshold
from synthroads_addon.base.errors import InputError, OutputError
from synthroads_addon.calibration.expected import (
    Expectation,
    ReceiverModel,
    Views,
    chosen_views,
    read_texture,
    texture_of,
)
from synthroads_addon.calibration.fit import BRIGHTEST, brighten_material, common_gain, fitted_slope, fitted_wavelength
from synthroads_addon.calibration.job import (
    Calibration,
    CalibrationJob,
    MaterialTarget,
    calibrate,
    calibration_steps,
    save_fitted,
)
from synthroads_addon.calibration.plot import save_plot
from synthroads_addon.cloud.selection.classes import RealClass, class_by_label, ranges_and_incidences, read_real_cloud
from synthroads_addon.cloud.selection.pavement import RoadClasses, road_classes
from synthroads_addon.materials.reflectance import facet_terms
from synthroads_addon.materials.table import Material, materials, read_material_table, write_material_table
from synthroads_addon.scenario.scenario import Scenario
from tests.helpers.clouds.calibration_cloud import labelled, striped
from tests.helpers.laser_equation import intensity_of

ASPHALT, PAINT = materials()["asphalt"], materials()["paint_white"]
ASKED = (MaterialTarget("asphalt", "40"), MaterialTarget("paint_white", "60"))


def even(**values: float) -> Material:
    return ASPHALT.model_copy(update=values)


@pytest.mark.parametrize("reflection", ["lambert", "oren_nayar"])
def test_expected_intensities_are_the_laser_equations(reflection) -> None:
    views = chosen_views((0.0, 30.0, 75.0), (20.0, 90.0))
    expectation = Expectation(views, ReceiverModel(attenuation=0.002), reflection)
    args = (np.cos(expectation.incidence), expectation.distance)
    wanted = intensity_of(ASPHALT.reflectivity, *args, ASPHALT.slope if reflection == "oren_nayar" else 0.0, 0.002)
    assert expectation.linear_intensities(ASPHALT) == pytest.approx(wanted)
    assert len(np.unique(np.stack([expectation.incidence, expectation.distance]), axis=1).T) == 6
    leaves = materials()["leaves"]
    opaque = leaves.model_copy(update={"transmission": 0.0})
    assert expectation.linear_intensities(leaves).max() < expectation.linear_intensities(opaque).max()


def test_many_views_are_a_sample_of_all() -> None:
    distance = np.linspace(50.0, 100.0, 100_000)
    seen = Expectation(Views(np.zeros(len(distance)), distance), ReceiverModel()).distance
    assert np.quantile(seen, (0.1, 0.5, 0.9)) == pytest.approx([55.0, 75.0, 95.0], rel=0.01)


def test_spread_keeps_the_mean_and_is_two_sided() -> None:
    expectation = Expectation(chosen_views((0.0,), (1.0,)), ReceiverModel())
    values = expectation.linear_intensities(even(spread_below=0.4, spread_above=0.2))
    assert values.mean() == pytest.approx(ASPHALT.reflectivity, rel=0.01)
    low, middle, high = np.log(np.quantile(values, (0.25, 0.5, 0.75)))
    assert (middle - low) / (high - middle) == pytest.approx(2.0, rel=0.06)
    again = Expectation(chosen_views((0.0,), (1.0,)), ReceiverModel())
    assert np.array_equal(values, again.linear_intensities(even(spread_below=0.4, spread_above=0.2)))


def test_a_strip_narrower_than_the_footprint_is_mixed_with_what_lies_beside() -> None:
    views = chosen_views((0.0,), (100.0,))
    wide, narrow = (
        Expectation(views, ReceiverModel((2e-3, 2e-3), range_corrected=True), strip=width) for width in (2.0, 0.05)
    )
    assert np.median(wide.linear_intensities(PAINT, ASPHALT)) == pytest.approx(
        PAINT.reflectivity + PAINT.retroreflection
    )
    mixed = narrow.linear_intensities(PAINT, ASPHALT)
    paint = PAINT.reflectivity + PAINT.retroreflection
    on_paint = (mixed - ASPHALT.reflectivity) / (paint - ASPHALT.reflectivity)
    # The middle of a Gaussian beam of the radius w on a strip of the width b: erf(b / sqrt 2 / w).
    assert 0.0 < on_paint.mean() <= on_paint.max() < 0.45


def test_receiver_writes_linear_numbers_or_decibels_and_back() -> None:
    values = np.array([1e-6, 0.2, 5.0])
    assert np.array_equal(ReceiverModel().to_stored(values), values)
    decibels = ReceiverModel(decibels=30.0)
    assert decibels.to_stored(np.array([1.0, 10.0])) == pytest.approx([0.0, 65535.0 / 3.0])
    assert decibels.to_linear(decibels.to_stored(values)) == pytest.approx(values)


def test_a_texture_gives_the_spread_of_its_pixels_over_the_footprint(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    pixels = np.where(rng.random((200, 200, 1)) < 0.5, 0.1, 0.3) * np.ones(3)
    texture = texture_of(pixels, 2.0, ASPHALT)
    assert texture.values.mean() == pytest.approx(1.0)
    assert texture.mean_color == pytest.approx((0.2, 0.2, 0.2), abs=0.01)
    views = chosen_views((0.0,), (50.0,))
    expectations = (Expectation(views, ReceiverModel((d, d)), texture=texture) for d in (0.0, 2e-3))
    fine, coarse = (expectation.linear_intensities(ASPHALT) for expectation in expectations)
    ratio = (ASPHALT.specular + 0.15) / (ASPHALT.specular + 0.05)
    assert np.quantile(fine, 0.9) / np.quantile(fine, 0.1) == pytest.approx(ratio, rel=1e-6)
    assert coarse.std() < 0.5 * fine.std()
    Image.fromarray(np.full((4, 8, 3), 188, dtype=np.uint8)).save(tmp_path / "grey.png")
    grey = read_texture(tmp_path / "grey.png", 1.0, ASPHALT)
    assert grey.mean_color[0] == pytest.approx(0.5029, abs=1e-3)
    assert grey.size == (1.0, 0.5)
    (tmp_path / "no.png").write_text("none")
    for name in ("no.png", "missing.png"):
        with pytest.raises(InputError, match=name):
            read_texture(tmp_path / name, 1.0, ASPHALT)


@pytest.mark.parametrize("decibels", [None, 30.0])
def test_a_fit_finds_what_was_put_in(tmp_path: Path, decibels: float | None) -> None:
    gain = 40.0 if decibels else 60_000.0
    cloud = labelled(tmp_path / "real.laz", decibels, gain)
    job = CalibrationJob(ASKED, real=cloud, class_field="label", range_corrected=True, decibels=decibels, gain=gain)
    result = calibrate(job)
    assert result.gain == gain
    asphalt, paint = (entry.after for entry in result.compared)
    assert asphalt.reflectivity == pytest.approx(0.2, rel=0.02)
    assert paint.reflectivity + paint.retroreflection == pytest.approx(0.5, rel=0.02)
    assert (asphalt.spread_below, asphalt.spread_above) == pytest.approx((0.3, 0.15), rel=0.06)
    assert (paint.spread_below, paint.spread_above) == pytest.approx((0.1, 0.2), rel=0.12)
    for entry in result.compared:
        errors = entry.errors()
        assert errors is not None
        assert np.abs(errors).max() < 0.05  # of which the finite number of samples leaves up to 0.03
    assert [entry.real.zeros for entry in result.compared if entry.real] == [50, 0]
    assert asphalt.base_color == ASPHALT.base_color


def test_a_comparison_changes_nothing_and_shows_what_is_wrong(tmp_path: Path) -> None:
    cloud = labelled(tmp_path / "real.laz", None, 60_000.0)
    job = CalibrationJob(ASKED, real=cloud, class_field="label", range_corrected=True, fit=False)
    result = calibrate(job)
    assert [entry.after for entry in result.compared] == [ASPHALT, PAINT]
    assert max(row["largest_error"] for row in result.to_dict()["classes"]) > 1.0
    with pytest.raises(InputError, match="--save"):
        save_fitted(result, tmp_path / "table.json")


def test_the_gain_is_one_for_all_and_changes_materials_least() -> None:
    rows = [even(), PAINT]
    assert common_gain(rows, [4.0, 4.41]) == pytest.approx(4.2)
    assert common_gain(rows, [4.0, 4.41], held_index=1) == 4.41
    assert common_gain(rows, [4.0, 4.41], known_gain=6.0) == 6.0
    # The paint may not reflect more than all: the gain is as large as that needs.
    least = 50.0 * PAINT.reflectivity / BRIGHTEST
    assert common_gain(rows, [2.0, 50.0]) == pytest.approx(least)
    with pytest.raises(InputError, match="--hold"):
        common_gain(rows, [2.0, 50.0], held_index=0)


def test_the_specular_changes_and_the_colour_stays_as_long_as_it_can() -> None:
    brighter = brighten_material(ASPHALT, 1.5)
    assert brighter.reflectivity == pytest.approx(1.5 * ASPHALT.reflectivity)
    assert brighter.base_color == ASPHALT.base_color
    dark = brighten_material(PAINT, 0.3)
    assert dark.reflectivity == pytest.approx(0.3 * PAINT.reflectivity)
    assert dark.retroreflection == pytest.approx(0.3 * PAINT.retroreflection)
    assert dark.base_color[0] == pytest.approx(0.3 * PAINT.base_color[0])
    steel = materials()["galvanised_steel"]
    assert brighten_material(steel, 1.3).reflectivity == pytest.approx(1.3 * steel.reflectivity)
    with pytest.raises(InputError, match="reflectivity"):
        brighten_material(PAINT, 3.0)


@given(st.sampled_from(sorted(materials())), st.floats(0.01, 3.0))
def test_a_brightened_material_is_one_of_the_table_or_refused(name: str, change: float) -> None:
    before = materials()[name]
    try:
        after = Material.from_dict(brighten_material(before, change).to_dict())
    except InputError:
        assert change > 1.0
        return
    assert after.reflectivity == pytest.approx(change * before.reflectivity, rel=1e-9, abs=1e-12)
    assert after.retroreflection == pytest.approx(change * before.retroreflection)


def test_the_slope_is_found_where_angles_differ() -> None:
    rng = np.random.default_rng(1)
    angle = np.deg2rad(rng.random(20_000) * 80.0)
    a, b = facet_terms(0.6)
    linear = (a * np.cos(angle) + b * np.sin(angle) ** 2) * np.exp(0.3 * rng.standard_normal(len(angle)))
    assert fitted_slope(angle, linear) == pytest.approx(0.6, abs=0.1)
    assert fitted_slope(angle * 0.05, linear) is None


@pytest.mark.parametrize("wavelength", [0.5, 4.0, 32.0])
def test_the_wavelength_is_found(wavelength: float) -> None:
    rng = np.random.default_rng(2)
    place = np.column_stack([rng.random((40_000, 2)) * (120.0, 12.0), np.zeros(40_000)])
    seen = np.exp(0.4 * noise_field(place, wavelength, 77, 3))
    assert fitted_wavelength(place, seen) == wavelength


def test_lines_are_found_where_they_are_and_not_by_each_points_own_brightness(tmp_path: Path) -> None:
    cloud, paint = striped(tmp_path / "road.laz", tmp_path / "axis.csv", 40.0)
    road = RoadClasses(tmp_path / "axis.csv", ((-6.0, 6.0),), (3.0,), 0.2)
    real = read_real_cloud(cloud)
    found = road_classes(real, road)
    on_paint = {tuple(row) for row in np.round(real.xyz[paint], 3).tolist()}
    right = [tuple(row) in on_paint for row in np.round(found["line"].place, 3).tolist()]
    assert np.mean(right) > 0.95
    assert len(right) > 0.4 * paint.sum()
    # A threshold on points would cut the dark ones off: these keep the whole spread.
    whole = np.quantile(real.intensity[paint], (0.1, 0.25, 0.5, 0.75, 0.9))
    kept = np.quantile(found["line"].intensity, (0.1, 0.25, 0.5, 0.75, 0.9))
    assert np.abs(kept - whole).max() < 0.12 * (whole[3] - whole[1])
    around = np.abs(real.xyz[:, 1] - 3.1) < 0.25
    by_itself = real.intensity[paint & (real.intensity > otsu_threshold(real.intensity[around]))]
    assert np.quantile(by_itself, 0.1) - whole[0] > 0.14 * (whole[3] - whole[1])
    assert not any(tuple(row) in on_paint for row in np.round(found["paved"].place, 3).tolist())


def test_otsu_lies_between_two_heaps() -> None:
    rng = np.random.default_rng(3)
    values = np.concatenate([rng.normal(10.0, 1.0, 5000), rng.normal(20.0, 1.0, 1000)])
    assert 12.5 < otsu_threshold(values) < 17.5


def test_ranges_and_angles_from_one_place_follow_the_ground() -> None:
    rng = np.random.default_rng(6)
    plan = rng.random((4000, 2)) * 30.0
    place = np.column_stack([plan, 0.2 * plan[:, 0]])
    none = np.full(4000, np.nan)
    real = RealClass("", place, np.ones(4000), 0, none, none, np.ones(4000, np.uint8))
    distance, incidence = ranges_and_incidences(real, np.array([0.0, 0.0, 50.0]))
    normal = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    towards = np.array([0.0, 0.0, 50.0]) - place
    assert distance == pytest.approx(np.linalg.norm(towards, axis=1))
    assert np.cos(incidence) == pytest.approx(towards @ normal / distance, abs=1e-6)


def run_job(**changes) -> Calibration:
    return calibrate(CalibrationJob((MaterialTarget("asphalt"),), **changes))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"incidence_deg": (90.0,)}, "--incidence-deg"),
        ({"incidence_deg": ()}, "--incidence-deg"),
        ({"ranges": (0.0,)}, "--range"),
        ({"decibels": 0.1}, "--decibels"),
        ({"scanner": (0.0, 0.0, 0.0)}, "--scanner"),
        ({"hold": "concrete"}, "--hold"),
        ({"gain": -1.0}, "--gain"),
        ({"device": "no-such"}, "scan.device"),
        ({"targets": ()}, "--material"),
        ({"targets": (MaterialTarget("asfalt"),)}, "did you mean 'asphalt'"),
        ({"targets": (MaterialTarget("asphalt", "40"),)}, "--material"),
        ({"targets": (MaterialTarget("asphalt"), MaterialTarget("asphalt"))}, "once"),
        ({"targets": (MaterialTarget("asphalt", texture_width=0.0),)}, "--texture"),
    ],
)
def test_bad_jobs_are_refused_before_any_work(changes, field: str) -> None:
    with pytest.raises(InputError, match=field):
        next(calibration_steps(CalibrationJob(**({"targets": (MaterialTarget("asphalt"),)} | changes))))


def test_classes_that_are_not_there_are_refused(tmp_path: Path) -> None:
    cloud = labelled(tmp_path / "real.laz", None, 60_000.0)
    real = read_real_cloud(cloud, "label")
    for code, message in (("41", "40, 60"), ("road", "a number")):
        with pytest.raises(InputError, match=f"--material asphalt .*{message}"):
            class_by_label(real, code, "--material asphalt")
    with pytest.raises(InputError, match="did you mean 'label'"):
        read_real_cloud(cloud, "labels")
    striped(tmp_path / "s.laz", tmp_path / "a.csv", 40.0)
    with pytest.raises(InputError, match="at least 200"):
        road_classes(real, RoadClasses(tmp_path / "a.csv", ((-39.0, -38.0),), ()))


def test_tables_are_read_and_written_back_and_taken_by_scenarios(tmp_path: Path) -> None:
    rows = {"asphalt": even(spread_below=0.3), "my tar": PAINT}
    path = tmp_path / "own.json"
    write_material_table(path, rows)
    assert read_material_table(path) == rows
    before = path.read_bytes()
    with pytest.raises(OutputError, match="--overwrite"):
        write_material_table(path, rows)
    write_material_table(path, rows, overwrite=True)
    assert path.read_bytes() == before
    assert Scenario.from_dict({"materials_table": str(path)}).own_materials() == rows
    assert Scenario().own_materials() == {}
    with pytest.raises(InputError, match="nothing"):
        Scenario.from_dict({"materials_table": str(tmp_path / "nothing.json")}).own_materials()
    with pytest.raises(InputError, match="must end in"):
        write_material_table(tmp_path / "own.txt", rows)
    path.write_text('{"materials": {"asphalt": {"base_color": [1, 1, 1], "roughness": 1, "specular": 2}}}')
    with pytest.raises(InputError, match="specular"):
        read_material_table(path)


def test_the_command_fits_saves_and_draws_the_same_bytes_twice(tmp_path: Path, capsys) -> None:
    cloud = labelled(tmp_path / "real.laz", 30.0, 40.0)
    common = ["calibrate", "--real", str(cloud), "--class-field", "label", "--range-corrected", "--decibels", "30"]
    common += ["--material", "asphalt=40", "--material", "paint_white=60"]
    for name in ("a", "b"):
        files = ["--save", str(tmp_path / f"{name}.json"), "--plot", str(tmp_path / f"{name}.png")]
        assert main([*common, *files, "--json"]) == 0
    printed = capsys.readouterr().out
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    report = json.loads(printed[: len(printed) // 2])
    assert report["classes"][0]["zeros_left_out"] == 50
    assert read_material_table(tmp_path / "a.json")["asphalt"].to_dict() == report["classes"][0]["after"]
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size[0] == 1200
        assert len(picture.getcolors(1 << 20)) > 100
    # The saved table explains the cloud without another fit.
    assert main([*common, "--table", str(tmp_path / "a.json"), "--no-fit", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert max(row["largest_error"] for row in again["classes"]) < 0.03
    assert again["gain"] == pytest.approx(report["gain"], rel=1e-3)


def test_the_command_refuses_in_one_line(tmp_path: Path, capsys) -> None:
    there = tmp_path / "there.png"
    there.write_text("x")
    for arguments, message in (
        (["--material", "asphalt", "--plot", str(there)], "is there already"),
        (["--material", "asphalt", "--save", str(tmp_path / "t.json")], "needs a cloud"),
        (["--material", "asphalt", "--fit", "everything"], "spread, wavelength, slope"),
        (["--material", "asphalt", "--texture", "asphalt"], "NAME=IMAGE"),
        (["--material", "asphalt", "--paved", "1,2"], "--axis"),
        (["--material", "asphalt=1", "--real", str(tmp_path / "none.laz")], "no such file"),
    ):
        assert main(["calibrate", *arguments]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1


def test_expected_values_without_a_cloud_are_listed_by_angle_and_range(tmp_path: Path, capsys) -> None:
    arguments = ["calibrate", "--material", "asphalt", "--incidence-deg", "0,60", "--range", "10,20", "--json"]
    assert main([*arguments, "--plot", str(tmp_path / "p.png")]) == 0
    views = json.loads(capsys.readouterr().out)["classes"][0]["views"]
    assert len(views) == 4
    first = next(view for view in views if view["incidence_deg"] == 0.0 and view["range"] == 10.0)
    assert first["50"] == pytest.approx(ASPHALT.reflectivity / 100.0, rel=1e-4)


def test_save_plot_wants_a_png(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="png"):
        save_plot(run_job(), tmp_path / "p.jpg")
