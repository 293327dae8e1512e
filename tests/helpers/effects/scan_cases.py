"""Scans on which each field of a scenario matters but those of the road, and what of it is changed to see that."""

from dataclasses import dataclass, field
from typing import Any

from synthroads_addon.scanning.cameras.choice import CameraChoice
from tests.helpers.effects.road_cases import STRAIGHT, base_road
from tests.helpers.effects.scans import FILES

Data = dict[str, Any]

PLANTS = {"density": 0.05, "band_start": 1.0, "band_end": 6.0, "height_min": 1.0, "height_max": 2.0, "seed": 1}
ROAD: Data = base_road(
    {
        "sign": {"type": "TrafficSign", "code": "449", "shape": "rectangle", "width": 3.0, "height": 2.0}
        | {"station": 30.0, "offset": -15.0},
        "rail": {"type": "Guardrail", "faces": "left", "offset": -14.5, **STRAIGHT},
        "shrubs": {"type": "Vegetation", "kind": "shrub", "species": "hazel", **PLANTS},
        "truck": {
            "type": "Vehicle",
            "model": "truck",
            "carriageway": "right",
            "lane": 0,
            "station": 10.0,
            "speed": 6.0,
        },
    }
)
"""Road of 60 m with something of every kind; as JSON data."""


@dataclass(frozen=True)
class ScanCase:
    """How a field of a scenario is looked at, as far as that doesn't follow from its type.

    Attributes:
        value: another value; if None what `other_values` takes.
        given: changes of `SCAN`, by path; None for what isn't to be given.
    """

    value: Any = None
    given: Data = field(default_factory=dict)


IMAGES = {"colour.source": "images"}
PATHS = IMAGES | {"colour.lighting": "path", "colour.max_resolution": 64}
RAYS = {"scan.rays_per_pulse": 7}
OPEN = {"scan.rays_per_pulse": None, "scan.noise.range_sigma": 0.0}
"""Nothing is given that a tolerance may choose."""
CHOSEN_COLOURS = {"colour": {"source": "auto"}, "cloud.attributes": ["roughness"]}
LOGARITHMIC = {"scan.receiver.response": "logarithmic"}
SWAYING = {"scan.motion.position_sigma": 0.2}
DAMPED = {"scan.noise.position_sigma": 0.05}
BY_RATE = {"scan.weather.visibility": None}


def platform(kind: str, **fields: Any) -> Data:
    """Return the change to a platform of a kind."""
    return {"scan.platform": {"kind": kind, **fields}}


PLATFORMS = {
    "uav": {"height": 30.0, "speed": 10.0, "lateral_offsets": [3.0, -3.0]},
    "vehicle": {"height": 2.5, "speed": 10.0, "lateral_offsets": [-6.0], "pitch_deg": 30.0},
    "airborne": {"height": 100.0, "speed": 30.0, "lateral_offsets": [3.0, -3.0]},
    "tripod": {"height": 1.8, "lateral_offsets": [-13.0], "station_spacing": 30.0, "turn_seconds": 4.0},
    "trajectory": {"file": str(FILES / "trajectory.csv")},
}
WEATHERS = {"clear": 20000.0, "haze": 3000.0, "fog": 300.0, "rain": 3000.0, "snow": 1000.0, "dust": 1500.0}
"""Weather -> a visibility of it, m."""


CLOUD = {"outputs": ["cloud"]}
CAMERAS: Data = {"megapixels": 0.004, "samples": 1, "spacing": 40.0}
"""Cameras with small pictures, of which there are few."""
SWEEPS: Data = {"formats": ["kitti"], "duration": 1.0}


def _camera_cases() -> dict[str, ScanCase]:
    usual, blurred = CLOUD | {"scan.cameras": CAMERAS}, CAMERAS | {"motion_blur": True, "exposure_ms": 50.0}
    values: Data = {
        "rig": "dji-p1",
        "trigger": "time",
        "megapixels": 0.003,
        "farthest": 30.0,
        "exposure_compensation": 1.0,
        "layers": ["rgb"],
    }
    cases = {f"scan.cameras.{name}": ScanCase(values.get(name), usual) for name in CameraChoice.model_fields}
    timed = CLOUD | {"scan.cameras": CAMERAS | {"trigger": "time", "interval": 4.0}}
    cases["scan.cameras.interval"] = ScanCase(3.0, timed)
    cases["scan.cameras.exposure_ms"] = ScanCase(10.0, CLOUD | {"scan.cameras": blurred})
    rolling = CAMERAS | {"rig": str(FILES / "rolling_rig.json")}
    cases["scan.cameras.rolling_shutter"] = ScanCase(True, CLOUD | {"scan.cameras": rolling})
    cases["scan.cameras.motion_blur"] = ScanCase(False, CLOUD | {"scan.cameras": blurred})
    return cases


def _sweep_cases() -> dict[str, ScanCase]:
    usual = CLOUD | {"sweeps": SWEEPS}
    values: Data = {"formats": ["kitti", "nuscenes"], "duration": 2.0, "box_range": 20.0, "box_classes": "road_sign"}
    return {f"sweeps.{name}": ScanCase(value, usual) for name, value in values.items()}


LATE = str(FILES / "late_trajectory.csv")
"""Trajectory that begins at some second of the GPS week."""


def _platform_cases() -> dict[str, ScanCase]:
    cases = {}
    for kind, fields in PLATFORMS.items():
        usual, swaying = platform(kind, **fields), platform(kind, **fields, path="zigzag")
        names = ("roll_deg", "pitch_deg", "yaw_deg", "height", "speed", "lateral_offsets", "path", "there_and_back")
        names = (*names, "station_spacing", "turn_seconds", "turn_deg")
        cases |= {f"scan.platform[{kind}].{name}": ScanCase(given=usual) for name in names}
        for name in ("zigzag_amplitude", "zigzag_wavelength"):
            cases[f"scan.platform[{kind}].{name}"] = ScanCase(given=swaying)
        smooth = platform(kind, **fields, path="smoothed")
        cases[f"scan.platform[{kind}].polynomial_degree"] = ScanCase(value=1, given=smooth)
    tripod = platform("tripod", **PLATFORMS["tripod"])
    cases["scan.platform[tripod].stations"] = ScanCase(value=[20.0], given=tripod)
    moved = platform("trajectory", **PLATFORMS["trajectory"])
    cases["scan.platform[trajectory].file"] = ScanCase(value=str(FILES / "other_trajectory.csv"), given=moved)
    cases["scan.platform[trajectory].height_shift"] = ScanCase(value=3.0, given=moved)
    cases["scan.platform[trajectory].keep_time"] = ScanCase(given=platform("trajectory", file=LATE))
    return cases


def _weather_cases() -> dict[str, ScanCase]:
    cases = {}
    for name, visibility in WEATHERS.items():
        given = {"scan.weather": {"condition": name, "visibility": visibility}}
        cases[f"scan.weather[{name}].visibility"] = ScanCase(value=0.5 * visibility, given=given)
        given = {"scan.weather": {"condition": name, "rate_mm_h": 5.0}}
        cases[f"scan.weather[{name}].rate_mm_h"] = ScanCase(value=10.0, given=given)
        given = {"scan.weather": {"condition": name, "visibility": 100.0 if name == "fog" else 300.0}}
        cases[f"scan.weather[{name}].echoes"] = ScanCase(given=given)
    return cases


LOOSE = {"height": 0.02, "position": 1.0, "relief": 1.0, "intensity": 9.0, "labels": 1.0, "density": 1.0}
LOOSE_COLOURS = {"colour": 100.0}
TIGHT = {"height": 0.002, "position": 0.01, "relief": 0.005, "intensity": 0.04, "labels": 0.012, "density": 0.01}
TIGHT_COLOURS = {"colour": 2.0}
"""Tolerances that the cheapest settings keep, and others that they don't."""


def _tolerance_cases() -> dict[str, ScanCase]:
    of_beam, of_colour = OPEN | {"tolerance": LOOSE}, OPEN | CHOSEN_COLOURS | {"tolerance": LOOSE_COLOURS}
    cases = {f"tolerance.{name}": ScanCase(value=value, given=of_beam) for name, value in TIGHT.items()}
    return cases | {
        f"tolerance.{name}": ScanCase(value=value, given=of_colour) for name, value in TIGHT_COLOURS.items()
    }


CASES: dict[str, ScanCase] = {
    "geometric_tolerance": ScanCase(value=0.001),
    "time_budget": ScanCase(value=1e6, given=OPEN),
    "materials_table": ScanCase(value="shifted"),
    "scan.device": ScanCase(value=str(FILES / "other_scanner.json")),
    "scan.pulse_rate_khz": ScanCase(value=1.0),
    "scan.field_of_view_deg": ScanCase(value=40.0),
    "scan.angle_step_deg": ScanCase(value=0.3, given={"scan.lines_per_second": None}),
    "scan.lines_per_second": ScanCase(value=10.0),
    "scan.platform": ScanCase(value={"kind": "tripod", "stations": [30.0], "turn_seconds": 3.0}),
    "scan.noise.range_sigma": ScanCase(value=0.03),
    "scan.noise.correlation_time": ScanCase(given=DAMPED),
    "scan.mirror_clock": ScanCase(value="free"),
    "scan.receiver.threshold_to_noise": ScanCase(value=5.0),
    "scan.receiver.overlap_begin": ScanCase(value=10.0, given={"scan.receiver.overlap_full": 60.0}),
    "scan.receiver.overlap_full": ScanCase(value=60.0),
    "scan.receiver.response": ScanCase(value="logarithmic"),
    "scan.receiver.bits": ScanCase(value=6, given=LOGARITHMIC),
    "scan.receiver.full_scale": ScanCase(value=3.0, given={"scan.receiver.response": "range_compensated"}),
    "scan.receiver.pedestal": ScanCase(value=2.0, given=LOGARITHMIC),
    "scan.receiver.compression": ScanCase(value=0.5, given=LOGARITHMIC),
    "scan.receiver.lost_numbers": ScanCase(value=0.3),
    "scan.receiver.soft_saturation": ScanCase(value=0.5),
    "scan.receiver.gain_sigma_db": ScanCase(value=1.0),
    "scan.receiver.faint_range_sigma": ScanCase(value=0.2),
    "scan.receiver.incidence_range_noise": ScanCase(value=1.0),
    "scan.receiver.range_walk": ScanCase(value=0.05, given={"scan.noise.speckle": 0.3}),
    "scan.receiver.range_tails": ScanCase(value=4.0),
    "scan.receiver.range_delay": ScanCase(value=0.5),
    "scan.receiver.echo_separation": ScanCase(value="waveform", given=RAYS),
    "scan.motion.shortest_period": ScanCase(value=3.0, given=SWAYING),
    "scan.motion.longest_period": ScanCase(value=9.0, given=SWAYING),
    "scan.motion.period_exponent": ScanCase(value=0.5, given=SWAYING),
    "scan.multipath": ScanCase(value=1000.0),
    "scan.relief_octaves": ScanCase(value=4),
    "scan.attenuation": ScanCase(value=0.01),
    "scan.weather": ScanCase(value={"condition": "fog"}),
    "scan.beam_rings": ScanCase(value=[5], given={"scan.rays_per_pulse": None}),
    "scan.beam": ScanCase(given=RAYS),
    "colour.source": ScanCase(value="images"),
    "colour.engine": ScanCase(given=IMAGES | {"colour.max_resolution": 16}),
    "colour.lighting": ScanCase(given=PATHS | {"colour.lighting": "direct"}),
    "colour.image_spacing": ScanCase(value=20.0, given=IMAGES),
    "colour.ground_sampling_distance": ScanCase(value=0.5, given=IMAGES),
    "colour.samples": ScanCase(value=1, given=PATHS),
    "colour.max_resolution": ScanCase(value=64, given=IMAGES | {"colour.ground_sampling_distance": 0.1}),
    "colour.intensity_from_layers": ScanCase(given=IMAGES),
    "cloud.start_time": ScanCase(value="2026-05-04T09:30:00Z"),
    "scene_formats": ScanCase(value=["gltf"], given={"outputs": ["scene"]}),
    "cloud.classes": ScanCase(value="5"),
    "cloud.point_spacing": ScanCase(value=1.0),
    "cloud.intensity_scale": ScanCase(value=1e6),
    **_camera_cases(),
    **_sweep_cases(),
    **_platform_cases(),
    **_weather_cases(),
    **_tolerance_cases(),
}
"""Path of a field -> how it is looked at; see `ScanCase`. A field that isn't here is looked at on the usual scan."""
