"""A road's centreline and corridor, regressed from slices of a cloud."""
