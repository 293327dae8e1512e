"""What a road is, exactly: parameter set, analytic geometry, guidelines. Nothing here is random."""
