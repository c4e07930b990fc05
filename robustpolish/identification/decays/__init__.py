"""Free decays: where they are cut, and which laws of damping they show."""
