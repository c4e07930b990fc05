"""The numbers of a model fitted to a prepared record, and how well they are known."""
