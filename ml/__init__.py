"""Learning on the scenes (PyTorch; no Blender)."""
