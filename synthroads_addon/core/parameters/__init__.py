"""What a road is: parameter set, analytic geometry, limits, sampler, placement."""
