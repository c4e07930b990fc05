"""Engines of dynamic output feedback, and the choice among their controllers."""
