"""Pictures of linear systems."""
