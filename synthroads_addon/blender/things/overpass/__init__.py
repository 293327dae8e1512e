"""Bridges over the road."""
