"""How good predicted centrelines are: metrics, intervals, baselines, tables and pictures."""
