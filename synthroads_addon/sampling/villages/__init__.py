"""What villages bring onto a road: their things and markings, islands at their ends, filled trenches, setts."""
