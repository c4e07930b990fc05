"""A model held against measurements: the error of free runs, windows and predictions."""
