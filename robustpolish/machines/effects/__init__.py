"""The catalogue of physical effects: what a kind is, and one file per kind."""
