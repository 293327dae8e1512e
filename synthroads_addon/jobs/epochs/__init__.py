"""The job "epochs": the same road surveyed several times, with the changes in between and their truth at each point."""
