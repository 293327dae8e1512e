"""Roads that join and cross the main one: ramps, the road above it, their surfaces and the ground between them."""
