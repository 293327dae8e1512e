"""Calibrate asphalt and white paint against real clouds; print the table of docs/calibration.md and draw its pictures.

python studies/realism/calibration.py REAL_FOLDER --output docs/pictures --tables out/tables
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import shlex
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from headless.cli import main as synthroads  # noqa: E402

AIRBORNE = "--device riegl-vq-780i --range 700 --incidence-deg 0,5,10,15,20 --range-corrected --decibels 30"
DUAL = "--paved=-10.9,-3.6 --paved=3.6,10.9"
CLOUDS = {
    "als_dual4lane_t338-369": f"{DUAL} --line=-10.45 --line=-6.65 --line=6.3 --line=10.35 {AIRBORNE}",
    "als_dual6lane_t370-473": f"{DUAL} --line=-10.6 --line=-6.35 --line=6.65 --line=10.4 {AIRBORNE}",
    "als_rural2lane_t000-075": f"--paved=-2,2 --line=0 {AIRBORNE}",
    "als_rural2lane_t211-278": f"--paved=-3,3 --line=0 {AIRBORNE}",
    "semkitti_seq00_000000": "--class-field label --scanner 0,0,0 --device velodyne-hdl-64e --range-corrected"
    " --reflection oren_nayar --fit spread,wavelength,slope",
}
PICTURES = {"als_dual4lane_t338-369": "calibration.png", "semkitti_seq00_000000": "calibration-vehicle.png"}
GIVES_GAIN = "als_dual4lane_t338-369"
"""The other clouds of its kind come from the same campaign: they take the gain that this one has."""


def command(folder: Path, name: str, gain: float | None, tables: Path, pictures: Path) -> list[str]:
    """Return the words of the command `synthroads calibrate` for one of `CLOUDS`."""
    is_airborne = name.startswith("als_")
    words = ["calibrate", "--real", str(folder / f"{name}.laz")]
    words += ["--axis", str(folder / f"{name}_axis.csv")] if is_airborne else []
    classes = ("paved", "line") if is_airborne else ("40", "60")
    for material, class_name in zip(("asphalt", "paint_white"), classes, strict=True):
        words += ["--material", f"{material}={class_name}"]
    words += shlex.split(CLOUDS[name])
    words += ["--gain", f"{gain:g}"] if gain is not None and is_airborne else []
    words += ["--save", str(tables / f"{name}.json")]
    words += ["--plot", str(pictures / PICTURES[name])] if name in PICTURES else []
    return words


def run_command(words: list[str]) -> dict[str, Any]:
    """Run a `synthroads` command; return its JSON report, or exit with its code if it fails."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        code = synthroads([*words, "--overwrite", "--json"])
    if code:
        raise SystemExit(code)
    report: dict[str, Any] = json.loads(output.getvalue())
    return report


def rows(name: str, report: dict[str, Any]) -> list[str]:
    """Return the Markdown table's lines, one per material, for one cloud's report."""
    lines = []
    for entry in report["classes"]:
        errors = entry["error_of_interquartile_range"].values()
        after = entry["after"]
        cells = [
            name,
            f"`{entry['material']}`",
            f"{entry['points']:,}",
            f"{entry['zeros_left_out']:,}",
            " / ".join(f"{entry['real'][q]:,.0f}" for q in ("25", "50", "75", "90")),
            " / ".join(f"{entry['expected'][q]:,.0f}" for q in ("25", "50", "75", "90")),
            " / ".join(f"{100 * error:+.1f}" for error in errors),
            f"{entry['reflectivity'][1]:.3f}",
            f"{after.get('spread_below', 0):.2f} / {after.get('spread_above', 0):.2f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def main() -> None:
    """Calibrate against every real cloud; print the table, gains and commands."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", type=Path, metavar="REAL_FOLDER")
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder for the pictures")
    parser.add_argument("--tables", type=Path, required=True, metavar="DIR", help="folder for the material tables")
    arguments = parser.parse_args()
    gain, gains = None, []
    for name in CLOUDS:
        words = command(arguments.real, name, gain, arguments.tables, arguments.output)
        report = run_command(words)
        gain = report["gain"] if name == GIVES_GAIN else gain
        gains.append(f"{name}: gain {report['gain']:g}")
        print("\n".join(rows(name, report)))
        print(f"    synthroads {shlex.join(words)}", file=sys.stderr)
    print("\n".join(gains))


if __name__ == "__main__":
    main()
