"""The peak of the gain in modal coordinates, with every rounding error enclosed."""
