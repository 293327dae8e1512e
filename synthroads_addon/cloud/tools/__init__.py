"""Tools for clouds: converting, thinning, statistics, pictures."""
