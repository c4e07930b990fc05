"""Random and hostile input for all that is public; seeds make every run the same."""
