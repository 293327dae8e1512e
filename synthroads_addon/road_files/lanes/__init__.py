"""The whole road of an OpenDRIVE file: lanes, surface, marks, objects and signals as objects of a parameter set."""
