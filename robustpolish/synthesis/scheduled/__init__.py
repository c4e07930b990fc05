"""Robust and scheduled feedback for polytopes of plants."""
