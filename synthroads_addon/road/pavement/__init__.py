"""Pavement as a field of station and offset: wheel tracks, joints, ages of what was paved at once."""
