"""Which folders of tests need Blender; they have a process of their own."""

from __future__ import annotations

BLENDER_TESTS = ("blender", "jobs", "ui")
