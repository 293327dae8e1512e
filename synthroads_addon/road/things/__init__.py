"""The things of a road as parameters: furniture, signs, vehicles, assets."""
