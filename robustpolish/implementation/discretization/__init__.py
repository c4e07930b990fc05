"""From a continuous controller to one that a computer runs at its samples."""
