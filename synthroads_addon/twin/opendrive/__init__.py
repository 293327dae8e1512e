"""OpenDRIVE 1.8."""
