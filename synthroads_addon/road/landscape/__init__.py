"""The landscape around a road, to the horizon: its relief, its parcels of land, and what stands on them."""
