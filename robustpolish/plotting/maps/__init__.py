"""Maps over a plane, and surfaces in space."""
