"""Lighting and surveillance poles."""

from collections.abc import Iterator
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ...base.arrays import Float
from ...base.schema import quantity
from .body import BURIED, Body, Place, box, circle, post, prism, rotate_x, shift
from .limits import Interval, Limits, interval, share
from .thing import Block, StandingThing, TwinTypes

MAST_TAPER, MAST_SIDES = 0.45, 16
"""Diameter of a mast at the top as a share of that at the foot, and its corners."""
ARM_RADIUS, SHORTEST_ARM = 0.03, 0.05
"""Radius of an arm, and length from which there is one, m."""
ARM_RISE, ARM_POINTS, ARM_SIDES = 0.12, 9, 8
"""Rise of an arm (m per m), the points of its quarter of an ellipse, and its corners."""
LUMINAIRE = (
    (0.06, -0.04), (0.06, 0.04), (-0.12, 0.13), (-0.58, 0.13), (-0.66, 0.08), (-0.66, -0.08), (-0.58, -0.13),
    (-0.12, -0.13),
)  # fmt: skip
"""A luminaire from above: x from its mount on, y, m."""
LUMINAIRE_DEPTH = 0.09
"""Thickness of a luminaire, m."""
CAMERA, CAMERA_TILT = (0.13, 0.4, 0.12), 8.0
"""A camera: across, along, height (m); it looks down by so many degrees."""
CAMERA_MOUNT, CAMERA_BELOW = 0.35, 0.3
"""How far an arm that carries cameras is below the top, and the pair of cameras below the arm, m."""
CAMERA_SHIELD = (0.03, 0.08, 0.008)
"""A sunshield: wider and longer than the camera, thickness, m."""
CAMERA_DOME = (0.09, 0.14, 0.17, 0.18)
"""A dome camera: radius; its cap's height; how far the cap's lower edge and the ball's middle are below the arm, m."""
POLE_CABINET = (0.3, 0.22, 0.45, 2.2)
"""A cabinet on a mast: width, depth, height, the height of its middle, m."""


class PoleLimits(Limits):
    """Limits of lighting and surveillance poles."""

    place: ClassVar = 40
    allowed: ClassVar = {
        "lighting_height": "height",
        "surveillance_height": "height",
        "lighting_spacing": (1.0, 1e4),
    }

    lighting: float = share(0.15, "Probability of lighting poles.", title="Lighting Poles")
    lighting_spacing: Interval = interval(35.0, 50.0, "m", "Spacing of lighting poles.")
    lighting_height: Interval = interval(10.0, 14.0, "m", "Height of lighting poles.")
    surveillance: float = share(0.2, "Probability of a surveillance pole.", title="Surveillance Pole")
    surveillance_height: Interval = interval(8.0, 15.0, "m", "Height of surveillance poles.")


class Pole(StandingThing):
    """A lighting pole, or one for surveillance cameras; its arm points away from rotation 0's traffic to the left."""

    points_class: ClassVar = "pole"
    order: ClassVar = 80
    limits: ClassVar = PoleLimits
    obstacle: ClassVar = "pole"
    type: Literal["Pole"] = "Pole"
    kind: Literal["lighting", "surveillance"] = Field("lighting", description="What it carries.")
    height: float = quantity(12.0, ge=2, le=30, unit="m", description="Top above the surface.")
    diameter: float = quantity(0.2, ge=0.05, le=0.6, unit="m", description="Diameter at its foot.")
    arm_length: float = quantity(1.5, ge=0, le=6, unit="m", description="Length of its arm; 0 for none.")

    def twin(self) -> TwinTypes:
        """Return its types in the twin formats: a mast and what it carries."""
        return TwinTypes("IfcElementAssembly.MAST.FACTORY", f"pole.{self.kind}", kind=self.kind)

    def bodies(self, place: Place) -> list[Body]:
        """Return the closed solids of the mast, its arm, and a street light or cameras, in its frame."""
        is_lighting = self.kind == "lighting"
        mount = self.height - (LUMINAIRE_DEPTH / 2.0 if is_lighting else CAMERA_MOUNT)
        rise = self.arm_length * ARM_RISE
        top = mount - rise if is_lighting else self.height
        circles = circle(self.diameter, MAST_SIDES), circle(self.diameter * MAST_TAPER, MAST_SIDES)
        rings = ((circles[0], -BURIED), (circles[0], 0.0), (circles[1], top))
        shapes = [np.stack([np.column_stack([ring, np.full(MAST_SIDES, z)]) for ring, z in rings])]
        if self.arm_length > SHORTEST_ARM:
            shapes.append(_arm(self.arm_length, mount, rise))
        door = box((self.diameter * 0.45, 0.02, 0.35), (0.0, self.diameter * -0.465, 0.8))
        mast = [Body(shape, "galvanised_steel", "column", "IfcColumn.COLUMN") for shape in shapes]
        door_body = Body(door, "galvanised_steel", "door", detail=0.02)
        return [*mast, door_body, *(self._luminaire() if is_lighting else self._cameras(mount))]

    def _luminaire(self) -> list[Body]:
        """Return the solid of the street light at the arm's end, and its glass as a detail."""
        bottom, top = self.height - LUMINAIRE_DEPTH, self.height
        outline = np.array(LUMINAIRE) - (self.arm_length, 0.0)
        glass = box((0.4, 0.2, 0.02), (-self.arm_length - 0.36, 0.0, bottom))
        return [
            Body(prism(outline, bottom, top), "cabinet_grey", "light", "IfcLightFixture.POINTSOURCE"),
            Body(glass, "lamp_glass", "glass", detail=0.01),
        ]

    def _cameras(self, mount: float) -> list[Body]:
        """Return the solids of a camera either way along the road, a dome at the arm's end, and the mast's cabinet."""
        camera_width, camera_length, camera_height = CAMERA
        shield_excess_width, shield_excess_length, shield_thickness = CAMERA_SHIELD
        distance, camera_z = (self.diameter + camera_length) / 2.0, mount - CAMERA_BELOW
        cabinet_width, cabinet_depth, cabinet_height, cabinet_z = POLE_CABINET
        shapes, fittings = (
            [box((cabinet_width, cabinet_depth, cabinet_height), (0.0, self.diameter / 2.0 + 0.1, cabinet_z))],
            [],
        )
        for side in (1.0, -1.0):
            place, facing = (0.0, -side * distance, camera_z), (side, side, 1.0)
            shapes.append(shift(rotate_x(box(CAMERA), np.deg2rad(CAMERA_TILT)), place, facing))
            shield = box(
                (camera_width + shield_excess_width, camera_length + shield_excess_length, shield_thickness),
                (0.0, -0.03, camera_height / 2.0 + 0.012),
            )
            lens = box((0.09, 0.02, 0.09), (0.0, -camera_length / 2.0, 0.0))
            fittings += [shift(rotate_x(shape, np.deg2rad(CAMERA_TILT)), place, facing) for shape in (shield, lens)]
        if self.arm_length > SHORTEST_ARM:
            radius, cap_height, cap_depth, ball_depth = CAMERA_DOME
            shapes.append(post(2.0 * radius, mount - cap_depth, mount - cap_depth + cap_height, -self.arm_length))
            fittings.append(
                box((1.8 * radius, 1.8 * radius, 1.8 * radius), (-self.arm_length, 0.0, mount - ball_depth))
            )
        cameras = [Body(shape, "cabinet_grey", "camera", "IfcAudioVisualAppliance.CAMERA") for shape in shapes]
        return [*cameras, *(Body(shape, "cabinet_grey", "fittings", detail=0.09) for shape in fittings)]

    def footprint(self) -> Iterator[Block]:
        """Yield the box of its mast, in which nothing else may stand."""
        yield self.upright(self.diameter / 2.0, self.height)


def _arm(length: float, mount: float, rise: float) -> Float:
    """Return the sections of a bent arm: a quarter of an ellipse from the mast's axis to the left, and up."""
    angles = np.pi / 2.0 * np.arange(ARM_POINTS) / (ARM_POINTS - 1.0)
    line = np.column_stack(
        [length * (np.cos(angles) - 1.0), np.zeros(ARM_POINTS), mount - rise * (1.0 - np.sin(angles))]
    )
    # Tangents at the points: at inner ones the mean direction of the two pieces that meet there.
    steps = np.diff(line, axis=0) / np.linalg.norm(np.diff(line, axis=0), axis=1)[:, None]
    tangent = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    normals = np.column_stack([-tangent[:, 2], tangent[:, 1], tangent[:, 0]])
    section = circle(2.0 * ARM_RADIUS, ARM_SIDES)
    return line[:, None] + section[None, :, :1] * normals[:, None] + section[None, :, 1:] * np.array([0.0, 1.0, 0.0])
