"""Detectors of changes judged by the truth of two epochs, and simple ones to compare them with."""
