"""A road's tables in use: what mends a broken rule, and the lines of its profile and cross-section."""
