"""Errors, checks, files, sweeps and tables that all other packages use."""
