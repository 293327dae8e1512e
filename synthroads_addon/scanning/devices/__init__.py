"""Laser scanners."""
