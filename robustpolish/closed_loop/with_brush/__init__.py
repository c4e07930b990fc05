"""Loops that the brush feels: its contact follows where the machine yields."""
