"""Certificates of sampled-data loops."""
