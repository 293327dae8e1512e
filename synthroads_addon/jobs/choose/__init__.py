"""Choosing settings by a tolerance or a time."""
