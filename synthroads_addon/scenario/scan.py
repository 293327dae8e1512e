"""`ScanScenario`: how a scene is scanned: device, platform, beam, radiometry, noise."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..base.schema import notes, quantity
from ..scanning.cameras.choice import CameraChoice
from ..scanning.devices.device import Device, DeviceChoice, ScannerSetting, load_device, setting_of
from ..scanning.noise import Noise
from ..scanning.platforms.registry import PlatformModel, make_platform
from ..scanning.strip_errors import StripErrors
from ..scanning.sway import Motion
from ..scanning.weather.registry import WeatherModel

MOST_POSSIBLE = 10**15
"""Pulses that no scan can have more of: what `--allow-large` allows."""
Footprints = Literal["full", "where_needed"]
_RingRays = Annotated[int, Field(ge=3, le=60)]


class ScanScenario(DeviceChoice):
    """How the road is scanned. What isn't given is the device's own value."""

    platform: PlatformModel = Field(make_platform(), description="Platform and path.")
    noise: Noise = Field(Noise(), description="Measurement noise.")
    strip_errors: StripErrors = Field(StripErrors(), description="Systematic errors of the strips.")
    motion: Motion = Field(Motion(), description="How the platform sways about its path.")
    multipath: float = quantity(
        0.0,
        "1",
        "Strength of ghost echoes, of what wet ground, steel and panes mirror: a factor on their power; 0 is none.",
        (0, 1000),
    )
    relief: float = quantity(
        1.0, "1", "Strength of the surfaces' micro-relief in the cloud; 0 is none.", (0, 100), title="Micro-Relief"
    )
    relief_octaves: int | None = quantity(
        None,
        "1",
        "Octaves of the micro-relief; the fidelity's if not given.",
        (1, 8),
        inherits="fidelity.relief_octaves",
    )
    relief_normals: bool = Field(
        False,
        description="Have normals and incidence angles of the points follow micro-relief, pavement and normal images.",
    )
    reflection: Literal["lambert", "oren_nayar"] = Field(
        "lambert",
        description="How rough surfaces reflect.",
        json_schema_extra=notes(labels={"oren_nayar": "Oren–Nayar"}),
    )
    attenuation: float | None = quantity(
        None,
        "1/m",
        "Attenuation per metre of range (there and back); else the weather's.",
        (0, 1),
        unset="The weather's",
    )
    weather: WeatherModel | None = Field(
        None, description="Weather; the road's own if not given.", json_schema_extra=notes(unset="The road's")
    )
    rays_per_pulse: Literal[1, 7, 19, 37, 61] | None = Field(
        None,
        description="Rays that sample a pulse's footprint; the fidelity's if not given.",
        json_schema_extra=notes(inherits="fidelity.rays_per_pulse"),
    )
    beam_rings: tuple[_RingRays, ...] | None = Field(
        None,
        max_length=6,
        description="Rays on each ring around the beam's axis, instead of rays_per_pulse.",
        json_schema_extra=notes(unset="By the rays"),
    )
    footprints: Footprints | None = Field(
        None,
        description="All rays of every pulse are cast, or only its axis where the footprint meets one plane of "
        "pavement or bare ground and nothing else; the fidelity's if not given.",
        json_schema_extra=notes(
            inherits="fidelity.footprints", labels={"full": "Cast in Full", "where_needed": "Where Needed"}
        ),
    )
    beam: Literal["conical", "cylindrical"] = Field(
        "conical", description="Rays diverge from the aperture, or run parallel over the footprint at the first hit."
    )
    traffic_speed_factor: float = quantity(
        1.0, "1", "Factor on the vehicles' speeds; 0 stops the traffic.", (0, 10), title="Speed of Traffic"
    )
    section_length: float | None = quantity(
        None,
        "m",
        "Roads longer than two of these are built and scanned section by section; if not given, roads of "
        "more than 5 km by sections of 500 m.",
        (20, 1e6),
        unset="500 m beyond 5 km",
    )
    most_pulses: int | None = quantity(
        None,
        "1",
        "Pulses beyond which the scan is refused before it begins; 5 thousand million if not given, and "
        "the scene must then fit into the machine's memory too.",
        (1, MOST_POSSIBLE),
        title="Most Pulses",
        unset="5 thousand million",
    )
    cameras: CameraChoice | None = Field(
        None, description="Cameras on the platform, and their images.", json_schema_extra=notes(unset="None")
    )
    caster: Literal["auto", "embree", "bvhtree"] = Field(
        "auto",
        description="How rays are cast.",
        json_schema_extra=notes(labels={"auto": "Automatic", "bvhtree": "BVH Tree"}),
    )
    kernels: Literal["auto", "off"] = Field(
        "auto",
        description="Use Embree's ray packets, compiled loops around it and compiled materials where this machine can; "
        "or cast every ray singly, with all materials rendered by Cycles and NumPy for the rest.",
        json_schema_extra=notes(labels={"auto": "Where Possible", "off": "Off"}),
    )
    threads: int = quantity(0, "1", "Threads; 0 uses every core.", (0, 1024))

    @model_validator(mode="before")
    @classmethod
    def _refuse_contradictions(cls, data: Any) -> Any:
        """Refuse two fields that say the same in different ways."""
        if isinstance(data, dict):
            for a, b in (("rays_per_pulse", "beam_rings"), ("attenuation", "weather")):
                if data.get(a) is not None and data.get(b) is not None:
                    raise ValueError(f"{a} and {b} can't both be given")
        return data


def scanner_setting(scan: ScanScenario, device: Device | None = None) -> ScannerSetting:
    """Return the scenario's scanner with the rates and angles that the scenario sets (`setting_of`).

    Args:
        scan: the scenario's.
        device: its device where that was read already; it is read now if None.

    Raises:
        InputError: there is no such device, it can't do it, or values contradict each other.
    """
    return setting_of(device or load_device(scan.device), scan, scan.noise.range_sigma)
