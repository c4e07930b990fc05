"""Drafts beside their final places: owned while their process lives, put in place at once."""
