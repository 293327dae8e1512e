"""Draw where the points of every scan pattern lie on flat ground: `docs/pictures/scan-patterns.png`.

Usage: python studies/scanner/patterns.py [FILE]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.figure import new_figure, save_figure  # noqa: E402
from synthroads_addon.scanning.devices.device import Device, load_device, setting_of  # noqa: E402
from synthroads_addon.scanning.devices.shots import shot_count, shots  # noqa: E402
from synthroads_addon.scenario.scan import ScanScenario  # noqa: E402

Float = NDArray[np.float64]

TARGET = ROOT / "docs" / "pictures" / "scan-patterns.png"


def generic(
    pattern: dict[str, object], rate_khz: float, view_deg: float, lines: float, **further_fields: object
) -> Device:
    """Return a device with a scan pattern, few pulses per line so that they can be told apart in a picture."""
    return Device.from_dict(
        load_device("generic-polygon").to_dict()
        | {
            "pattern": pattern,
            "modes": [{"pulse_rate_khz": rate_khz, "field_of_view_deg": view_deg, "maximum_range": 100.0}],
            "lines_per_second": [lines, lines],
        }
        | further_fields
    )


def wedges(*turns: int) -> dict[str, object]:
    """Return the JSON data of a pattern of one or two rotating wedge prisms, by the ratio of their turns."""
    angle, index = (33.582, 1.509) if len(turns) == 1 else (25.39, 1.51)
    return {
        "type": "wedge_prism",
        "wedges": [{"angle_deg": angle, "refractive_index": index, "turns": turn} for turn in turns],
    }


MIRROR: dict[str, object] = {"type": "rotating_mirror"}
SWINGING: dict[str, object] = {"type": "oscillating_mirror"}
BEAMS: dict[str, object] = {"type": "rotating_head", "elevations_deg": [-30.0, -25.0, -20.0, -15.0, -10.0]}
CROSSED = [{"yaw_deg": 45.0}, {"yaw_deg": -45.0}]


@dataclass(frozen=True)
class Panel:
    """One panel of the picture: a device above flat ground, its height, speed (m/s), duration (s), half-width (m)."""

    title: str
    device: Device
    height: float = 20.0
    speed: float = 40.0
    duration: float = 0.5
    half: float = 16.0


PANELS = [
    Panel(
        "grid\n20 rows of 20, one frame",
        generic({"type": "grid", "rows": 20, "along_field_deg": 60.0}, 2, 60, 100),
        speed=0,
        duration=0.2,
    ),
    Panel("rotating mirror\nfires within 90° of each turn", generic(MIRROR, 10, 90, 50), half=24),
    Panel("polygon mirror\nevery pulse within 60°", generic({"type": "polygon_mirror"}, 2.5, 60, 50)),
    Panel("oscillating mirror, triangular", generic(SWINGING, 2.5, 60, 25)),
    Panel("oscillating mirror, sinusoidal", generic(SWINGING | {"motion": "sinusoidal"}, 2.5, 60, 25)),
    Panel(
        "one wedge, at rest,\ntilted forward by 40°",
        generic(wedges(1), 5, 46, 10, heads=[{"pitch_deg": 40.0}]),
        speed=0,
        duration=0.1,
        half=24,
    ),
    Panel("one wedge, moving", generic(wedges(1), 5, 46, 10), speed=15, duration=1.2, half=20),
    Panel("two wedges, at rest\nturns 3647 : −2332, 0.1 s", load_device("livox-mid-70"), speed=0, duration=0.1),
    Panel(
        "rotating head, five beams\none turn, 2 m above ground",
        generic(BEAMS, 10, 360, 10),
        height=2,
        speed=0,
        duration=0.1,
        half=12,
    ),
    Panel(
        "two rotating mirrors, yaw ±45°\n2 m above ground",
        generic(MIRROR, 20, 150, 50, heads=CROSSED),
        height=2,
        speed=15,
        half=6,
    ),
]


def on_ground(panel: Panel) -> tuple[Float, Float]:
    """Return where a panel's pulses hit flat ground: offsets to the right and ahead, both (N,), m."""
    setting = setting_of(panel.device, ScanScenario())
    shot = shots(setting, 0, shot_count(setting, panel.duration))
    forward, leftward, upward = shot.direction
    is_downward = upward < -1e-6
    distance = -panel.height / upward[is_downward]
    return -distance * leftward[is_downward], panel.speed * shot.time[is_downward] + distance * forward[is_downward]


def main(target: Path = TARGET) -> None:
    """Write the picture of all patterns' points on the ground to a PNG file."""
    figure = new_figure(16, 7.4)
    axes = figure.subplots(2, 5)
    for axis, panel in zip(axes.flat, PANELS, strict=True):
        rightward, forward = on_ground(panel)
        forward -= (
            (forward.max() + forward.min()) / 2.0 if "tilted" in panel.title else panel.speed * panel.duration / 2.0
        )
        axis.scatter(rightward, forward, s=1.2, c=np.arange(len(rightward)), cmap="viridis", linewidths=0)
        axis.set(xlim=(-panel.half, panel.half), ylim=(-panel.half, panel.half), aspect="equal")
        axis.set_title(panel.title, fontsize=10)
        axis.tick_params(labelsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("ahead (m)")
    for axis in axes[-1]:
        axis.set_xlabel("to the right (m)")
    target.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, target, dpi=100)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("file", type=Path, nargs="?", default=TARGET)
    main(parser.parse_args().file)
