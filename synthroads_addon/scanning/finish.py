"""Finish of a block's points after the scan: colours and layers, intensities from these, micro-relief."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import AnyArray, Float, Index
from ..cloud.layers import optional_arrays
from ..cloud.points import NO_MATERIAL, PointBlock
from ..materials.reflectance import reflectivity
from ..materials.surfaces import Surfaces
from .colour.colour import LayerSource, LayerValues, SeenPoints, sample_points
from .plan import ScanPlan
from .receiving.detector import Readout
from .receiving.radiometry import DARKEST_DB, decibels
from .receiving.response import range_corrected
from .relief.micro_relief import BeamEnds, MicroRelief, ReliefField, shift_by_relief
from .relief.normals import tilt_normals, turn_normals
from .returns import number_returns
from .scan import BlockResult

OF_INTENSITY = frozenset({"base_color", "metallic", "specular"})
"""Material layers that an intensity follows from."""
_DARKEST = 1e-9
OPTIONAL = optional_arrays()


@dataclass(frozen=True)
class Finish:
    """The stages that blocks go through after the scan: colours, layers, micro-relief and final intensities.

    Attributes:
        plan: the scan.
        source: of colours and layers.
    """

    plan: ScanPlan
    source: LayerSource

    def finish_block(self, result: BlockResult) -> BlockResult:
        """Return a block, or several joined, with colours, layers, micro-relief and final intensities, for the sink."""
        plan = self.plan
        if result.seen is not None and (plan.layers.coloured or plan.reception.after_layers):
            result = self._with_layers(result, result.seen)
        points = result.points
        if result.seen is not None and plan.relief.micro is not None:
            points = self._with_relief(points, result.seen, plan.relief.micro)
        if result.seen is not None and plan.relief.images is not None:
            points = tilt_normals(points, *self._tilts(points, result.seen), result.seen.towards_scanner)
        changes: dict[str, AnyArray | None] = dict.fromkeys(points.attributes().keys() & OPTIONAL - plan.layers.kept)
        if plan.reception.range_corrected:
            changes["intensity"] = range_corrected(points.intensity, points.range, plan.setting)
        return replace(result, points=points.with_arrays(changes), seen=None)

    def _with_relief(self, points: PointBlock, seen_points: SeenPoints, relief: MicroRelief) -> PointBlock:
        """Return points shifted to where their beams meet the surface's relief, and their normals if planned."""
        plan, pavement = self.plan, self.plan.relief.pavement
        map_place = seen_points.position + plan.target.origin
        # Only what stands still has a relief, so that beams in the scene at time 0 are the true ones.
        ends = BeamEnds(
            seen_points.position + plan.reflection.frame_origin, seen_points.towards_scanner, plan.setting.beam_angle
        )
        relief_settings = relief, plan.relief.strength, plan.reflection.surface_seed, plan.relief.octaves
        pavement_heights = None if pavement is None else pavement.heights(points.instance_id, map_place)
        shifted_points = shift_by_relief(points, ends, *relief_settings, pavement_heights)
        if not plan.relief.normals or shifted_points is points:
            return shifted_points
        field = ReliefField(points, ends, *relief_settings)

        def heights(rows: Index, offset: Float) -> Float:
            """Return the heights (K,), m, of roughness and pavement together at offsets (K, 3), m, from points."""
            pavement_height: Float | float = 0.0
            if pavement is not None:
                pavement_height = pavement.heights(points.instance_id[rows], map_place[rows] + offset)
            return field.heights(rows, offset) + pavement_height

        return turn_normals(shifted_points, field.rough_rows, ends.towards, heights)

    def _tilts(self, points: PointBlock, seen_points: SeenPoints) -> tuple[Index, Float]:
        """Return the indices (K,) of the points that normal images tilt, and their tilts: see `NormalImages.tilts`."""
        plan = self.plan
        assert plan.relief.images is not None
        map_place = seen_points.position + plan.target.origin
        frame_place = seen_points.position + plan.reflection.frame_origin
        normal = np.asarray(seen_points.normal, np.float64)
        footprint = points.range * plan.setting.beam_angle  # m
        return plan.relief.images.tilts(
            seen_points.material, points.instance_id, map_place, frame_place, normal, footprint
        )

    def _with_layers(self, result: BlockResult, seen_points: SeenPoints) -> BlockResult:
        """Return a block with its points' colours and layers, and with the intensities that follow from these."""
        plan = self.plan
        layer_names = plan.layers.coloured | (OF_INTENSITY if plan.reception.after_layers else set())
        values = sample_points(self.source, seen_points, layer_names)
        changes: dict[str, Any] = {name: values.arrays[name] for name in plan.layers.coloured}
        changes["color_source"] = values.source
        if plan.reception.after_layers:
            assert plan.layers.means is not None
            factors = layer_brightness(plan.layers.means, seen_points, values)
            if plan.relief.images is not None:
                rows, tilts = self._tilts(result.points, seen_points)
                factors[rows] *= tilted_brightness(seen_points.normal[rows], tilts, seen_points.towards_scanner[rows])
            changes["intensity"] = result.points.intensity * factors
            if (power := result.points.array("power_db")) is not None:
                changes["power_db"] = np.maximum(power + decibels(factors), DARKEST_DB)
        result = replace(result, points=result.points.with_arrays(changes))
        if plan.reception.after_layers:
            result = read_echoes(result, plan)
        assert result.points.color_source is not None
        return replace(result, sources=np.bincount(result.points.color_source, minlength=256))


def layer_brightness(means: Surfaces, seen_points: SeenPoints, values: LayerValues) -> Float:
    """Return factors (N,) by which points are brighter by their own layers than by their materials' means.

    A return has the layers of what gave most of it. Dirt, print and wear dim what beads and prisms send back as they
    dim the rest. What comes from the air doesn't change.

    Args:
        means: of the scene's materials, which the layers vary around.
        seen_points: N points.
        values: their layers.
    """
    layer_reflectivity = reflectivity(*(values.arrays[name] for name in ("base_color", "metallic", "specular")))
    mean_reflectivity = np.take(means.reflectivity, seen_points.material, mode="clip")
    factor = np.asarray(layer_reflectivity / np.maximum(mean_reflectivity, _DARKEST))
    factor[seen_points.material == NO_MATERIAL] = 1.0
    return factor


def tilted_brightness(normal: AnyArray, tilts: Float, scanner_direction: AnyArray) -> Float:
    """Return factors (K,) by which tilting their normals makes points brighter: Lambert's cos(tilted) / cos(face).

    Args:
        normal: (K, 3) unit normals of the faces.
        tilts: (K, 3) vectors along the faces that are added to the normals.
        scanner_direction: (K, 3) unit vectors to the scanner.
    """
    tilted_normal = normal + tilts
    tilted_normal /= np.linalg.norm(tilted_normal, axis=1)[:, None]
    cosine_before, cosine_after = (
        np.einsum("ij,ij->i", vectors, scanner_direction) for vectors in (normal, tilted_normal)
    )
    return np.asarray(np.maximum(cosine_after, 0.0) / np.maximum(cosine_before, _DARKEST))


def read_echoes(result: BlockResult, plan: ScanPlan) -> BlockResult:
    """Return a block as the detector records it, once the layers have given its intensities.

    Echoes below the threshold and those beyond the device's largest number of returns are lost; the others get new
    return numbers, and their intensities saturate. The returns of a pulse have one time and lie side by side.
    """
    points, readout, setting = result.points, result.readout or Readout(), plan.setting
    detected = np.flatnonzero(readout.detected(points.intensity, setting.threshold))
    time, strip = np.take(points.gps_time, detected), np.take(points.strip, detected)
    echo_number = np.take(points.return_number, detected)
    begins_pulse = np.ones(len(detected), dtype=bool)
    # Some heads fire several lasers at once: pulses of one time are told apart by their numbers, which begin anew.
    begins_pulse[1:] = (time[1:] != time[:-1]) | (strip[1:] != strip[:-1]) | (echo_number[1:] <= echo_number[:-1])
    recorded_mask, number, returns = number_returns(np.cumsum(begins_pulse), setting.device.maximum_returns)
    rows, seen_points = detected if recorded_mask.all() else detected[recorded_mask], result.seen
    if len(rows) < len(points):
        points, readout = points.select(rows), readout.select(rows)
        seen_points = None if seen_points is None else seen_points.select(rows)
    intensity, clipped = readout.read(points.intensity, points.range, setting, plan.gains)
    return replace(
        result,
        points=replace(points, intensity=intensity, return_number=number, number_of_returns=returns),
        seen=seen_points,
        below_threshold=result.below_threshold + len(result.points) - len(detected),
        saturated=clipped,
        readout=None,
    )
