"""`ScenarioInputs`: what the files that a scenario names hold: device, classes, materials, read once for a job."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..base.classes import ClassScheme
from ..materials.table import Material
from ..scanning.cameras.rig import CameraRig, load_rig
from ..scanning.devices.device import Device, ScannerSetting, load_device
from ..scanning.platforms.platform import Platform
from .scan import ScanScenario, scanner_setting
from .scenario import Scenario


@dataclass(frozen=True)
class ScenarioInputs:
    """Content of the files that a scenario names, presets included: a job reads each once, whatever becomes of it.

    Attributes:
        device: laser scanner that `scan.device` names.
        scheme: classes that `cloud.classes` names.
        materials: of the scenario's own table, by name; empty without one.
        platform: with its trajectory, if a file has it.
        rig: of cameras that `scan.cameras` names; None without cameras.
    """

    device: Device
    scheme: ClassScheme
    materials: Mapping[str, Material]
    platform: Platform
    rig: CameraRig | None = None

    @classmethod
    def read(cls, scenario: Scenario) -> ScenarioInputs:
        """Read and check the files that a scenario names.

        Raises:
            InputError: there is no such device, class scheme, material table or trajectory, or it isn't as it must be;
                or the device can't do what the scenario asks for.
        """
        device = load_device(scenario.scan.device)
        scanner_setting(scenario.scan, device)
        cameras = scenario.scan.cameras
        rig = None if cameras is None else load_rig(cameras.rig)
        return cls(device, scenario.cloud.scheme(), scenario.own_materials(), scenario.scan.platform.opened(), rig)

    def setting(self, scan: ScanScenario) -> ScannerSetting:
        """Return the device with the rates and angles that a scan sets; see `scanner_setting`.

        Raises:
            InputError: the device can't do it, or values contradict each other.
        """
        return scanner_setting(scan, self.device)
