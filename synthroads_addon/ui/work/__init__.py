"""Long-running work of the panel, and the operators that start it."""
