"""Using a trained centreline model on a cloud."""
