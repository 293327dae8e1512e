"""Platforms and their paths."""
