"""Write `synthroads_addon/presets/parameters.schema.json` from the classes that declare it.

Usage: python tools/make_schema.py
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from synthroads_addon.road.parameters import write_schema  # noqa: E402

if __name__ == "__main__":
    write_schema(ROOT / "synthroads_addon" / "presets" / "parameters.schema.json")
