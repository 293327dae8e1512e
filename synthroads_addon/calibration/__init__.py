"""Materials fitted to the intensities of a real cloud."""
