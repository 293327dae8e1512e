"""Stages of the scan of one block: pulses as they leave the scanner, their echoes, and the points that these become."""
