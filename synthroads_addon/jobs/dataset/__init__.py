"""Making data sets: scenes side by side in processes of their own, each published as a whole."""
