"""Plants: grass, shrubs and trees."""
