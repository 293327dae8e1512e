"""Learning from the scenes, with PyTorch and without Blender.

`centerline` regresses a road's centreline and corridor from slices of a cloud, `segmentation` gives every point a
class. What both learning tasks share stands beside them: data, networks, scores, configurations, runs and the training
loop.
"""
