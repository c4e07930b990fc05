"""Output feedback of full order."""
