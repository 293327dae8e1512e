"""Networks in plain PyTorch: a folder for each task, one file for each network."""
