"""The rules, one file per family, and the road as they read it."""
