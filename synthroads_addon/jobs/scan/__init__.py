"""Scanning a road into files, whole or by section."""
