"""Alignment, profile, crossfall and widths of a road as tables, row by row, and edits of a row."""
