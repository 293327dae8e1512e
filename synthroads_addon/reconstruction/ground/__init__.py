"""The ground beside and between lines: medians, and the dark band of a road without paint."""
