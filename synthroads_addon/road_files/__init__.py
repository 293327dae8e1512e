"""Roads and alignments in other programs' files: read exactly, and turned into the axis of a parameter set."""
