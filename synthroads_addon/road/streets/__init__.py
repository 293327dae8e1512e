"""Sides of a road inside a village: gutter, parking bays, kerb and footway."""
