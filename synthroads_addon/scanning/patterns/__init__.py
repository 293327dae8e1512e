"""Scan patterns: when each pulse of a head is fired, and where to. One file each."""
