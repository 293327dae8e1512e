"""Effects on the samples of a training: cheap, on the fly, each drawn from the sample's own stream."""
