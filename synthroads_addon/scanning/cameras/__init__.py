"""Cameras beside the scanner: lenses, rigs, when they are triggered, and what each pixel sees."""
