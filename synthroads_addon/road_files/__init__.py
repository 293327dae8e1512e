"""Roads in other programs' files, on maps and of tracks: read, and turned into the axis of a parameter set."""
