"""Least-squares fits of parameters to free runs."""
