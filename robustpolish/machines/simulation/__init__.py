"""Time simulation of mechanical models with effects."""
