"""Inequalities of dynamic output feedback."""
