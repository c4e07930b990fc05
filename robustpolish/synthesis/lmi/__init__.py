"""Linear matrix inequalities of state and output feedback."""
