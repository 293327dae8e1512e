"""Fits and what is written of them have the same last bits on any number of cores: they take one thread."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, NoReturn

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import headless.reconstruct
from synthroads_addon.base.progress import exhaust
from synthroads_addon.calibration import job as calibration
from synthroads_addon.calibration import sensor_files
from synthroads_addon.comparison import job as comparison
from synthroads_addon.fitting import fit
from synthroads_addon.reconstruction import centreline, report
from synthroads_addon.twin import formats


class BegunError(Exception):
    """The work has begun, with so many threads of each library of linear algebra."""


def begin(*_: object, **__: object) -> NoReturn:
    raise BegunError({library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"})


class Argument:
    """Argument of a job that is looked at first of all."""

    def __getattr__(self, name: str) -> Any:
        return begin()


JOBS: dict[str, tuple[ModuleType, str, Callable[[], object]]] = {
    "a fit of an axis": (fit, "_check_points", lambda: fit.fit_axis([])),
    "a reconstruction": (report, "read_road_cloud", lambda: report.run_reconstruction(Argument())),  # type: ignore[arg-type]
    "its files": (headless.reconstruct, "check_formats", lambda: headless.reconstruct.run(Argument())),  # type: ignore[arg-type]
    "a centreline": (centreline, "straighten_path", lambda: centreline.find_centreline(Argument())),  # type: ignore[arg-type]
    "a twin": (formats, "check_formats", lambda: formats.write_twin(Argument(), Argument(), [])),  # type: ignore[arg-type]
    "a calibration": (calibration, "check_job", lambda: exhaust(calibration.calibration_steps(Argument()), print)),  # type: ignore[arg-type]
    "a sensor": (sensor_files, "estimate_sensor", lambda: sensor_files.fit_sensor(Argument())),  # type: ignore[arg-type]
    "a comparison": (
        comparison,
        "find_clouds",
        lambda: exhaust(comparison.compare_steps(Argument(), Argument()), print),  # type: ignore[arg-type]
    ),
}


@pytest.mark.parametrize("name", JOBS)
def test_its_linear_algebra_takes_one_thread(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, first, job = JOBS[name]
    monkeypatch.setattr(module, first, begin)
    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(BegunError) as begun:
            job()
        with pytest.raises(BegunError) as elsewhere:
            begin()
    assert begun.value.args == ({1},)
    assert elsewhere.value.args == ({2},)
