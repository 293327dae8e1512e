"""From a cloud back to a parameter set: path, lines, alignment, section, objects; and how far the cloud is from it."""
