"""Frequency responses in: from files, from objects, and estimated from time records."""
