"""A model meets measured frequency responses."""
