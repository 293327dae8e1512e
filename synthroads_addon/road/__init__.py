"""The road, exactly: parameter set, analytic geometry, guidelines. Nothing here is random."""
