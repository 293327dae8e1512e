"""The road's axis and carriageways as tables, and its profile and cross-section drawn in an image editor."""

from . import operators, panel, profile_view, rows

MODULES = (rows, operators, profile_view, panel)
"""Modules whose classes Blender is to know, in the order of their registration."""
