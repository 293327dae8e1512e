"""Which rules of the guidelines a road breaks."""
