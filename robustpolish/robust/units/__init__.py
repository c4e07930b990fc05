"""The units in which a loop is looked at, which do not depend on those that it came in."""
