"""Networks on point clouds, in plain PyTorch, and what they need to know of a cloud's geometry."""
