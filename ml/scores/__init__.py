"""How good predictions are: metrics, intervals, baselines, tables and pictures."""
