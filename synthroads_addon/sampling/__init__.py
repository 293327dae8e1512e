"""Roads drawn from a seed within limits."""
