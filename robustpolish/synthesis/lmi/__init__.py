"""Designs by linear matrix inequalities, and the programs that state them."""
