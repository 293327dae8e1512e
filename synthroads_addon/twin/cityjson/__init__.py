"""CityJSON 2.0."""
