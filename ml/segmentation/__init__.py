"""A class for every point: data, recipes, training, scores and prediction on whole clouds."""
