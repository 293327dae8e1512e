"""Write `synthroads_addon/presets/parameters.schema.json` from the classes that declare it.

Usage: python tools/make_schema.py
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.base.schema import canonical_json  # noqa: E402
from synthroads_addon.road.parameters import parameters_schema  # noqa: E402

if __name__ == "__main__":
    path = ROOT / "synthroads_addon" / "presets" / "parameters.schema.json"
    path.write_text(canonical_json(parameters_schema()), encoding="utf-8")
