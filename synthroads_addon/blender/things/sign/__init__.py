"""Traffic signs."""
