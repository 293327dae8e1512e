"""Laser scanners: presets and settings."""
