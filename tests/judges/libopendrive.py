"""OpenDRIVE, judged by libOpenDRIVE: the surface that it makes of a file, lane by lane."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from synthroads_addon.base.arrays import Float
from synthroads_addon.road.geometry import RoadGeometry
from tests.judges import bringing
from tests.judges.samples import Samples

SOURCE = "../shared/readers"
"""Where its source is looked for, from the repository's folder, with what builds it and prints a surface."""
_FOLDER = bringing.BUILD / "libopendrive"
_PAVED, _BORDER = 0.002, 0.06
"""How far (m) the surface may lie above or below ours, and borders in plan beside ours: the places that a border is
given for lie up to 5 cm along the road from where it is, on roads that are tilted and climb; along tapers that shows.
"""


def _archive() -> Path | None:
    return next((Path(__file__).resolve().parents[2] / SOURCE).glob("libOpenDRIVE-*.tar.gz"), None)


def version() -> str | None:
    """Return the commit that was built; None if it isn't here."""
    return (_FOLDER / "commit").read_text(encoding="utf-8") if (_FOLDER / "surface").is_file() else None


def bring() -> None:
    """Build it, if its source and the tools are here."""
    archive = _archive()
    if archive is None or not all(map(shutil.which, ("sh", "tar", "cmake", "make", "g++"))):
        return
    commit = archive.name.removeprefix("libOpenDRIVE-").removesuffix(".tar.gz")
    said = ["sh", "-c", f"printf %s {commit} > {{}}/commit"]
    bringing.install(_FOLDER, ["sh", str(archive.with_name("build.sh")), "{}"], said)


def verdict(samples: Samples) -> list[str]:
    """Return in what its surface differs from the analytic one, at the borders of all lanes."""
    return surface_faults(samples.file("twin.xodr"), samples.geometry)


def surface(path: Path) -> tuple[list[str], list[list[str]], Float]:
    """Return what it complains of in a file, its rows (station and number of a lane first), and points (N, 3), m.

    The points lie on the outer borders of all lanes, every 5 m, in the file's coordinates.
    """
    done = subprocess.run([str(_FOLDER / "surface"), str(path)], capture_output=True, text=True, check=True)
    faults = sorted(set(re.findall(r"\[(?:ERROR|WARN\w*)\] (.*)", done.stdout + done.stderr)))
    rows = [line.split() for line in done.stdout.splitlines() if not line.startswith("[")]
    return faults, rows, np.array([[float(value) for value in row[4:7]] for row in rows])


def surface_faults(path: Path, geometry: RoadGeometry) -> list[str]:
    """Return in what the surface that it makes of a file differs from a road's, at the borders of all lanes."""
    found, rows, points = surface(path)
    if len(rows) < geometry.length:
        return [*found, f"{len(rows)} points only"]
    s, t = geometry.alignment.project(points[:, :2])
    s = np.clip(s, 0.0, geometry.length)
    # At a ramp's end the road changes within 5 cm.
    steady = np.abs(geometry.offsets(s + 0.1) - geometry.offsets(s - 0.1)).max(axis=1) < 0.1
    rows, points = [row for row, kept in zip(rows, steady, strict=True) if kept], points[steady]
    s, t = s[steady], t[steady]
    away = np.abs(geometry.offsets(s) - t[:, None])
    border = away.argmin(axis=1)
    levels = np.take_along_axis(geometry.boundary_elevations(s), border[:, None], axis=1)[:, 0]
    for name, error, limit in (
        ("a border", away.min(axis=1), _BORDER),
        ("the surface", np.abs(points[:, 2] - levels), _PAVED),
    ):
        worst = int(np.argmax(error))
        if error[worst] > limit:
            found.append(f"{name} is {error[worst]:.4f} m off in lane {rows[worst][1]} at {s[worst]:.1f} m")
    return found
