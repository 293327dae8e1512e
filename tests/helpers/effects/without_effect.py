"""Fields that change neither the model nor the points: they only say something."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from synthroads_addon.checking.checker import check
from synthroads_addon.road.parameters import RoadParameters
from synthroads_addon.twin.formats import write_twin


def set_of(parameters: RoadParameters) -> Any:
    """Return what the set's own file says."""
    return parameters.to_json()


def findings(parameters: RoadParameters) -> Any:
    """Return what the checker finds."""
    return check(parameters)


def twin(name: str) -> Callable[[RoadParameters], Any]:
    """Return what gives a road's semantic model in a format."""

    def written(parameters: RoadParameters) -> Any:
        with TemporaryDirectory() as folder:
            write_twin(parameters, Path(folder), (name,), 0.02)
            return [path.read_bytes() for path in sorted(Path(folder).glob("twin.*")) if "report" not in path.name]

    return written


SAYS: dict[str, Callable[[RoadParameters], Any]] = {
    **{f"metadata.{name}": set_of for name in ("identifier", "title", "generator")},
    **{f"metadata.{name}": set_of for name in ("referenceSystem", "heightReferenceSystem")},
    "design_class": findings,
    **{f"Asset.twin_types.{name}": twin(name) for name in ("cityjson", "ifc", "opendrive")},
    "LineMarking.turnout": findings,
    "Tree.stock": findings,
    "Building.at_street": findings,
    "ConnectingRamp.design_speed": findings,
    **{f"Alignment.{name}": twin("ifc") for name in ("first_station", "equations")},
    **{f"Alignment.equations[].{name}": twin("ifc") for name in ("station", "ahead")},
}
"""Field of a parameter set -> where it is seen, and nowhere in the model or the points."""
DERIVED = {f"{kind}.horizontal[].kind" for kind in ("Alignment", "ConnectingRamp", "CrossingRoad")}
"""Fields that have no other value: it follows from others beside them, and any other is refused."""
