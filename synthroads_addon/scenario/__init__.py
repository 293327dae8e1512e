"""The scenario: the one description of a job."""
