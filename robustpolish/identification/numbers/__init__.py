"""A model's own numbers refitted, by themselves and before anything is said to be missing."""
