"""State feedback."""
