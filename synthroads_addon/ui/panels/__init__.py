"""The panels in the 3D view's sidebar."""
