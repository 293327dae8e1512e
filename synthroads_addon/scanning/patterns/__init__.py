"""Scan patterns: when each pulse is fired, and where to."""
