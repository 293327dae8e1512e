"""Lenses against formulas written anew: OpenCV's, and the sphere's."""

import math

import jsonschema
import numpy as np
import pytest

from synthroads_addon.base.errors import InputError
from synthroads_addon.scanning.cameras.lens import Lens, pixel_centres
from synthroads_addon.scanning.cameras.rig import Camera, load_rig, rig_names

OF_SCHEMA = ("focal_length_mm and pixel_size_um must be given", "three values at most")
"""Messages about cameras that the JSON Schema refuses as well."""
PINHOLE = Lens("pinhole", 640, 480, (500.0, 510.0), (322.0, 236.0), (-0.28, 0.09, -0.012), (0.0011, -0.0007))
FISHEYE = Lens("fisheye", 640, 640, (200.0, 201.0), (318.0, 322.0), (0.03, -0.01, 0.002, -0.0001))
SPHERE = Lens("equirectangular", 720, 360, (0.0, 0.0), (0.0, 0.0))


def opencv_pinhole(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Return places (N, 2) by the formula in OpenCV's documentation of calib3d."""
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r2 = x**2 + y**2
    k1, k2, k3 = lens.radial
    p1, p2 = lens.tangential
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.column_stack([u * lens.focal[0] + lens.centre[0], v * lens.focal[1] + lens.centre[1]])


def opencv_fisheye(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Return places (N, 2) by the formula in OpenCV's documentation of the module fisheye."""
    radius = np.hypot(points[:, 0], points[:, 1])
    angle = np.arctan2(radius, points[:, 2])
    bent = angle * (1 + sum(k * angle ** (2 * n) for n, k in enumerate(lens.radial, 1)))
    x, y = bent * points[:, 0] / radius, bent * points[:, 1] / radius
    return np.column_stack([x * lens.focal[0] + lens.centre[0], y * lens.focal[1] + lens.centre[1]])


@pytest.mark.parametrize(("lens", "formula"), [(PINHOLE, opencv_pinhole), (FISHEYE, opencv_fisheye)])
def test_places_follow_opencv(lens: Lens, formula) -> None:
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-0.6, 0.6, (4000, 2)), np.ones(4000)]) * random.uniform(1, 80, (4000, 1))
    wanted_places = formula(lens, points)
    seen = lens.project(points.T).T
    inside = (wanted_places > 0).all(axis=1) & (wanted_places < (lens.width, lens.height)).all(axis=1)
    assert inside.sum() > 2000
    assert np.abs(seen[inside] - wanted_places[inside]).max() < 1e-9
    assert np.isnan(seen[~inside]).all()


@pytest.mark.parametrize("lens", [PINHOLE, FISHEYE, SPHERE], ids=lambda lens: lens.model)
def test_rays_and_places_are_inverse(lens: Lens) -> None:
    places = pixel_centres(lens, 0, lens.height)
    rays = lens.rays(places)
    assert np.abs(np.linalg.norm(rays, axis=0) - 1.0).max() < 1e-12
    assert np.abs(lens.project(rays * 37.0) - places).max() < 1e-7


def test_a_sphere_is_even_in_angles() -> None:
    right, down, behind = (
        SPHERE.project(np.array([[x], [y], [z]])).ravel() for x, y, z in ((1, 0, 0), (0, 1, 1), (0, 0, -1))
    )
    assert right == pytest.approx([540.0, 180.0])
    assert down == pytest.approx([360.0, 270.0])
    assert behind[0] in (0.0, 720.0)


def test_nothing_is_seen_behind_a_pinhole_nor_where_its_formula_turns_back() -> None:
    assert np.isnan(PINHOLE.project(np.array([[0.1], [0.0], [-1.0]]))).all()
    strong = Lens("pinhole", 640, 480, (300.0, 300.0), (320.0, 240.0), (-0.5,))
    # r (1 - 0.5 r^2) grows up to r = sqrt(2 / 3), and points farther out would be folded back into the image.
    assert math.tan(strong.reach) == pytest.approx(math.sqrt(2 / 3), abs=1e-3)
    assert np.isnan(strong.project(np.array([[1.2], [0.0], [1.0]]))).all()


def test_the_field_of_view_ends_where_it_is_said() -> None:
    lens = Lens("fisheye", 640, 640, (200.0, 200.0), (320.0, 320.0), largest_angle=math.radians(60))
    rays = lens.rays(pixel_centres(lens, 0, 640))
    angle = np.degrees(np.arccos(rays[2][~np.isnan(rays[2])]))
    assert 59.5 < angle.max() < 60.01
    assert np.isnan(rays).any()


def test_fewer_pixels_see_the_same() -> None:
    camera = load_rig("kitti-stereo").cameras[0]
    whole, small = camera.lens(), camera.lens(0.1)
    assert small.width * small.height == pytest.approx(1e5, rel=0.01)
    share = np.array([[0.1, 0.5, 0.93], [0.2, 0.5, 0.77]])
    size, small_size = np.array([[whole.width], [whole.height]]), np.array([[small.width], [small.height]])
    assert np.abs(whole.rays(share * size) - small.rays(share * small_size)).max() < 1e-9


@pytest.mark.parametrize("name", rig_names())
def test_shipped_rigs_are_read(name: str) -> None:
    rig = load_rig(name)
    assert rig.title
    assert len(rig.source) > 60
    for camera in rig.cameras:
        assert camera.lens().width == camera.width


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"radial": [-0.9]}, "doesn't reach the edges"),
        ({"focal_length_mm": None}, "focal_length_mm and pixel_size_um must be given"),
        ({"model": "fisheye", "tangential": [0.1, 0.0], "radial": []}, "tangential must not be given"),
        ({"model": "equirectangular"}, "twice as wide as high"),
        ({"radial": [0.0, 0.0, 0.0, 0.1]}, "three values at most"),
    ],
)
def test_impossible_lenses_are_refused(change: dict, text: str) -> None:
    data = {"name": "a", "width": 1000, "height": 800, "pixel_size_um": 5.0, "focal_length_mm": 4.0}
    schema = Camera.model_json_schema()
    Camera.from_dict(data)
    jsonschema.validate(data, schema)
    with pytest.raises(InputError, match=text):
        Camera.from_dict(data | change)
    if text in OF_SCHEMA:
        changed = {name: value for name, value in (data | change).items() if value is not None}
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(changed, schema)


def test_axes_of_a_mounted_camera() -> None:
    ahead = Camera.from_dict({"name": "a", "width": 10, "height": 10, "pixel_size_um": 5.0, "focal_length_mm": 4.0})
    left_down = ahead.model_copy(update={"yaw_deg": 90.0, "pitch_deg": -30.0})
    assert np.allclose(ahead.mounting(), [[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    assert np.allclose(left_down.mounting() @ [0, 0, 1], [0, math.cos(math.radians(30)), -0.5])
    assert np.allclose(left_down.mounting() @ [1, 0, 0], [1, 0, 0])  # its right is forward
