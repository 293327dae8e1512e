"""OpenDRIVE, judged by libOpenDRIVE: the surface that it makes of a file, lane by lane."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from tests.judges import bringing
from tests.judges.samples import Samples

SOURCE = "../shared/readers"
"""Where its source is looked for, from the repository's folder, with what builds it and prints a surface."""
_FOLDER = bringing.BUILD / "libopendrive"
_NO_SHAPE = "Lateral Profile Shape not supported"
"""Message for every file with a lateral shape: its surface is level across but for lanes with a height."""
_MILLIMETRE = 1e-3


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
    """Return in what its surface differs from the analytic one; the lateral shape it doesn't read is left out."""
    done = subprocess.run(
        [str(_FOLDER / "surface"), str(samples.file("twin.xodr"))], capture_output=True, text=True, check=True
    )
    said = re.findall(r"\[(?:ERROR|WARN\w*)\] (.*)", done.stdout + done.stderr)
    rows = [line.split() for line in done.stdout.splitlines() if not line.startswith("[")]
    found = sorted(set(said) - {_NO_SHAPE})
    if len(rows) < 1000:
        return [*found, f"{len(rows)} points only"]
    s, t, x, y, z, level = np.array([[float(value) for value in (row[0], *row[3:])] for row in rows]).T
    verge = np.array([row[2] == "shoulder" for row in rows])
    geometry = samples.geometry
    away = np.abs(geometry.offsets(s) - t[:, None]).min(axis=1)
    position, heading, _ = geometry.alignment.frame(s)
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    plan = np.linalg.norm(np.column_stack([x, y]) - position - t[:, None] * left, axis=1)
    # The height of a lane is at right angles to the reference line, which climbs.
    plan -= np.abs((z - level) * geometry.profile.grade(s))
    fall = np.where(verge, _verge_fall(samples, s, t), 0.0)
    for name, error in {
        "borders' offset": away,
        "borders in plan": plan,
        "the reference line's height": np.abs(level - geometry.profile.elevation(s)),
        "the verges' fall": np.abs(level - z - fall),
    }.items():
        worst = int(np.argmax(error))
        if error[worst] > 0.2 * _MILLIMETRE:
            found.append(f"{name}: {error[worst]:.4f} m off in lane {rows[worst][1]} at {s[worst]:.1f} m")
    return found


def _verge_fall(samples: Samples, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return how far (N,) verges' outer borders lie below the planes of their pavement, m: what lanes' heights say."""
    fall = np.zeros(len(s))
    for side, section in samples.geometry.sections.items():
        carriageway = section.carriageway
        rise = carriageway.sign * samples.geometry.crossfall(carriageway, s)
        own = (np.abs(t) - section.plane_edge(s)) * (carriageway.verge_slope_percent / 100.0 + rise)
        fall = np.where((t > 0.0) == (side == "left"), own, fall)
    return fall
