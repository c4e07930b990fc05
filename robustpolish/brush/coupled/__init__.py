"""The brush on a machine that yields: contact and machine feel each other."""
