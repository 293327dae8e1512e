"""The parameter set, judged by jsonschema."""

from __future__ import annotations

import json

from synthroads_addon.road.parameters import parameters_schema
from tests.judges.samples import Samples


def verdict(samples: Samples) -> list[str]:
    """Return what in the set doesn't fit the published schema, and what in the schema isn't one."""
    import jsonschema

    validator = jsonschema.Draft202012Validator
    schema = parameters_schema()
    found = [*validator(validator.META_SCHEMA).iter_errors(schema)]
    found += validator(schema).iter_errors(json.loads(samples.text("parameters.json")))
    return [f"{'.'.join(map(str, error.absolute_path))}: {error.message[:200]}" for error in found]


def with_a_negative_length(samples: Samples) -> Samples:
    """Return files with a parameter set whose first element is shorter than nothing."""
    data = json.loads(samples.text("parameters.json"))
    axis = next(item for item in data["objects"].values() if item["type"] == "Alignment")
    axis["horizontal"][0]["length"] *= -1.0
    return samples.with_file("parameters.json", json.dumps(data).encode())
