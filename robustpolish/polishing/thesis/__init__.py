"""The thesis's simulator, controllers and comparisons."""
