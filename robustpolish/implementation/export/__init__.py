"""A sampled controller in the files of other programs."""
