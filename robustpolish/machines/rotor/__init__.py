"""Shafts that spin: beam elements, discs and bearings, whirl, and plants made of them."""
