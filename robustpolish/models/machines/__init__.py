"""Machines whose numbers come with the package."""
