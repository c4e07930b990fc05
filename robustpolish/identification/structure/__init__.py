"""Selection of the physical effects that a model lacks."""
