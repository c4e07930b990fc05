"""Designs by Riccati equations."""
