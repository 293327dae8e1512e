"""Files of images, judged by nerfstudio's own reader: lenses, poses, and the ray of each pixel."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from synthroads_addon.jobs.images.album import Album
from synthroads_addon.jobs.images.nerfstudio import write_nerfstudio
from tests.helpers.scenes.album import album
from tests.judges import bringing
from tests.judges.samples import Samples
from tests.judges.sweeps import version_of

PACKAGES = ("nerfstudio==1.1.5", "jaxtyping==0.2.36", "viser==0.2.7", "opencv-python-headless==4.11.0.86")
"""Packages that its reader of data needs, without what they require: the tests have PyTorch and the rest."""
_FOLDER = bringing.BUILD / "nerfstudio"
_PIXELS = 200
"""Places of each image that are compared."""
_ANGLE, _PLACE = 2e-5, 1e-5
"""Largest difference of directions, rad, and places, m: nerfstudio works in single precision, by ten Newton steps."""
_READER = """
import json, sys, types
from pathlib import Path
from unittest.mock import MagicMock
# The transforms of viser alone, and no writers of logs: what they need isn't installed.
package = types.ModuleType("viser")
package.__path__ = [str(Path(sys.argv[1]) / "viser")]
sys.modules |= {"viser": package, "torch.utils.tensorboard": MagicMock(), "wandb": MagicMock()}
import torch
from nerfstudio.data.dataparsers.nerfstudio_dataparser import NerfstudioDataParserConfig
result = []
for name, places in json.loads(Path(sys.argv[2]).read_text()).items():
    config = NerfstudioDataParserConfig(
        data=Path(name), orientation_method="none", center_method="none", auto_scale_poses=False,
        downscale_factor=1, load_3D_points=False, eval_mode="all",
    )
    read = config.setup().get_dataparser_outputs("train")
    places = torch.tensor(places)
    for index, file in enumerate(read.image_filenames):
        numbers = torch.full((len(places), 1), index)
        rays = read.cameras.generate_rays(camera_indices=numbers, coords=places)
        result.append({
            "index": name, "file": str(file),
            "width": int(read.cameras.width[index]), "height": int(read.cameras.height[index]),
            "origins": rays.origins.tolist(), "directions": rays.directions.tolist(),
        })
print(json.dumps(result))
"""

version = version_of("nerfstudio")


def bring() -> None:
    """Download it."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--disable-pip-version-check"]
    bringing.install(_FOLDER, [*pip, "--target", "{}", *PACKAGES])


def verdict(samples: Samples) -> list[str]:
    """Return rays of pixels that nerfstudio takes to come from or go to another place, by three models of lenses."""
    images, folder = album(), _written(samples)
    names = ["transforms.json", *(f"transforms_{model}.json" for model in images.models[1:])]
    random = np.random.default_rng(3)
    places: dict[Path, np.ndarray] = {}
    for name, model in zip(names, images.models, strict=True):
        lens = images.of_model(model)[0].camera.lens
        inside = random.uniform([1.0, 1.0], [lens.width - 1.0, lens.height - 1.0], (_PIXELS, 2))
        places[folder / name] = inside[~np.isnan(lens.rays(inside.T)[0])]
    read = _read(samples.folder, places)
    if isinstance(read, str):
        return [read]
    shots = {f"rgb/{shot.stem}.{images.picture}": shot for shot in images.shots}
    found = [] if len(read) == len(shots) else [f"{len(read)} images"]
    for image in read:
        file = Path(image["file"]).relative_to(folder).as_posix()
        found += [f"{file}: {fault}" for fault in _faults(images, shots[file], image, places[Path(image["index"])])]
    return found


def _written(samples: Samples) -> Path:
    """Return the folder of the files of images, written unless they are there."""
    folder = samples.folder / "images"
    if not folder.exists():
        folder.mkdir()
        write_nerfstudio(folder, album())
    return folder


def _faults(images: Album, shot: Any, image: dict[str, Any], places: np.ndarray) -> list[str]:
    """Return what nerfstudio takes differently of one image, at places (N, 2), px."""
    lens = shot.camera.lens
    directions = shot.rotation @ lens.rays(places.T)
    directions /= np.linalg.norm(directions, axis=0)
    found = []
    if (image["width"], image["height"]) != (lens.width, lens.height):
        found.append(f"{image['width']} x {image['height']} pixels")
    off = np.abs(np.array(image["origins"]) - (shot.position - images.origin)).max()
    if off > _PLACE:
        found.append(f"{off:.3g} m off")
    angle = np.linalg.norm(np.array(image["directions"]) - directions.T, axis=1).max()
    if angle > _ANGLE:
        found.append(f"a ray goes {angle:.3g} rad aside")
    return found


def _read(work: Path, places: dict[Path, np.ndarray]) -> list[dict[str, Any]] | str:
    """Return the rays of places (N, 2), px, in the images of files; the fault if these can't be read."""
    wanted = work / "places.json"
    rows = {str(file): inside[:, ::-1].tolist() for file, inside in places.items()}  # row and column
    wanted.write_text(json.dumps(rows))
    script = f"import sys; sys.path.insert(0, {str(_FOLDER)!r})\n{_READER}"
    words = [sys.executable, "-W", "ignore", "-c", script, str(_FOLDER), str(wanted)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        return done.stderr[-400:]
    read: list[dict[str, Any]] = json.loads(done.stdout.splitlines()[-1])
    return read


def with_another_focal_length(samples: Samples) -> Samples:
    """Return files in which a camera of nerfstudio's has another focal length."""
    folder = _written(samples)
    data = json.loads((folder / "transforms.json").read_text())
    data["frames"][0]["fl_x"] *= 1.01
    spoiled = samples.folder / "spoiled-images"
    shutil.copytree(folder, spoiled / "images", dirs_exist_ok=True)
    (spoiled / "images" / "transforms.json").write_text(json.dumps(data))
    return Samples(spoiled)
