"""The built-in kinds of effects, one per file; each file gives its ``KIND``."""
