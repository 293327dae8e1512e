"""A scan into a folder that runs beside the window and can be stopped. Once begun it touches no Blender data."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import asdict
from pathlib import Path
from threading import Event, Thread

from .. import version
from ..core.cloud.centerline import centerline_geojson
from ..core.colour import MaterialLayers, surface_constants
from ..core.errors import Cancelled
from ..core.files import output_folder
from ..core.parameters.geometry import RoadGeometry
from ..core.parameters.model import RoadParameters
from ..core.parameters.tessellation import sample_stations
from ..core.scanning.motion import ScannedScene
from ..core.scenario import Scenario
from ..core.schema import canonical_json
from ..pipeline import Job, ScanToFiles, check, file_names, make_scan, material_rows, road_path, top_view


class ScanJob:
    """One scan into a folder. It is refused at once if it can't be done; nothing half-written is ever left.

    Args:
        scenario: the road's and the scan's settings.
        parameters: the road that the scene shows.
        scene: what is scanned.
        target: folder for the files.
        overwrite: replace files that are already there.

    Attributes:
        target: folder for the files.
        share: how much is done, 0 to 1.
        points: how many points were written; None until all files are complete.
        error: what ended it early, if something did; `Cancelled` after `stop`.

    Raises:
        InputError: a setting is wrong or the folder can't be written.
    """

    def __init__(
        self, scenario: Scenario, parameters: RoadParameters, scene: ScannedScene, target: Path, overwrite: bool
    ) -> None:
        check(Job(scenario, target, overwrite=overwrite))
        self.target = target
        self.share = 0.0
        self.points: int | None = None
        self.error: Exception | None = None
        self._stopping = Event()
        self._thread: Thread | None = None
        self._steps = self._write_files(scenario, parameters, scene, overwrite)
        next(self._steps)

    def run(self) -> None:
        """Do the whole work; raise what goes wrong."""
        try:
            for share in self._steps:
                self.share = share
                if self._stopping.is_set():
                    raise Cancelled("the scan was cancelled")
        finally:
            self._steps.close()

    def start(self) -> None:
        """Do the work in a thread of its own, so that the window stays alive."""
        self._thread = Thread(target=self._run_and_keep_error, name="SynthRoads scan")
        self._thread.start()

    @property
    def running(self) -> bool:
        """Return whether its thread is at work."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def state(self) -> str:
        """Return what it is doing, in words for the window."""
        if self._stopping.is_set():
            return "Stopping"
        return f"Scanning {self.share:.0%}" if self.share else "Preparing"

    def stop(self, wait: bool = False) -> None:
        """Have the thread stop after the block at hand; `wait` until it has."""
        self._stopping.set()
        if wait and self._thread is not None:
            self._thread.join()

    def _run_and_keep_error(self) -> None:
        try:
            self.run()
        except Exception as error:
            self.error = error

    def _write_files(
        self, scenario: Scenario, parameters: RoadParameters, scene: ScannedScene, overwrite: bool
    ) -> Generator[float, None, None]:
        """Write all files, yielding the share that is done: first once the folder is found to be writable."""
        names = file_names(scenario, scenario.outputs)
        with output_folder(self.target, names, overwrite) as folder:
            rows = material_rows(scene.static.materials)
            yield 0.0
            geometry = RoadGeometry(parameters)
            stations = sample_stations(geometry, scenario.settings().tolerance)
            scan = make_scan(scenario, scene, road_path(scenario, geometry), parameters.environment)
            # Rendering would hold up the window: colours are the materials' own.
            source = MaterialLayers(surface_constants(rows))
            task = ScanToFiles(scenario, scan, source, folder, parameters.metadata.epsg, top_view(geometry))
            yield from task.run()
            texts = {
                "parameters.json": parameters.to_json(),
                "centerline.geojson": canonical_json(centerline_geojson(geometry, stations)),
                "report.json": canonical_json(_report(scenario, task)),
            }
            for name, text in texts.items():
                (folder / name).write_text(text, encoding="utf-8")
        self.points = task.counts.points


def _report(scenario: Scenario, task: ScanToFiles) -> dict[str, object]:
    return {
        "type": "Report",
        "generator": f"SynthRoads {version()}",
        "counts": task.summary(),
        "seed": scenario.seed,
        "settings": asdict(scenario.settings()),
        "scenario": scenario.to_dict(),
    }


latest: ScanJob | None = None
"""The scan that the window runs, or ran last."""


def scanning() -> bool:
    """Return whether the window runs a scan."""
    return latest is not None and latest.running
