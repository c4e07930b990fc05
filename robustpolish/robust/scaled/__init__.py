"""Scalings that prove a level: the space of them, their analytic centre, the least level."""
