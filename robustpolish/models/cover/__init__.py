"""One plant with an error of bounded gain in place of a family of plants."""
