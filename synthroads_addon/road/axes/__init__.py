"""Axes of roads in files: read, written, and stations and offsets beside them."""
