"""Roads as a centreline model sees them: slices in the frames of a path, with their truth, in batches."""
