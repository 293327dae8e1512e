"""Plants: where those of a stand grow, and how large each is."""
