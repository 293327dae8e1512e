"""Placing what stands on and beside a sampled road."""
