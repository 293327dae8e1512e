"""Write `parameters.schema.json` and `changes.schema.json` in `synthroads_addon/presets` from their classes.

Usage: python tools/make_schema.py
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.schema import canonical_json  # noqa: E402
from synthroads_addon.road.changes.change import changes_schema  # noqa: E402
from synthroads_addon.road.parameters import parameters_schema  # noqa: E402

if __name__ == "__main__":
    presets = ROOT / "synthroads_addon" / "presets"
    for name, schema in (("parameters", parameters_schema()), ("changes", changes_schema())):
        (presets / f"{name}.schema.json").write_text(canonical_json(schema), encoding="utf-8")
