"""Data that are learned from: labelled points as tiles and crops, roads as slices along a path, effects on both."""
