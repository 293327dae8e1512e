"""Structures that carry the road or lead it through the ground: bridges, tunnels, and the ground around them."""
