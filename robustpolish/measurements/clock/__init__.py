"""The time of a record: which column it is, what its stamps say, and a uniform grid."""
