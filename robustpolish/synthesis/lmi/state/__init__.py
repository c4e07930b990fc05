"""Inequalities of state feedback."""
