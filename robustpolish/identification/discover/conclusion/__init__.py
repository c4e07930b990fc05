"""The end of a diagnosis: final fit, verdict, a law in place of names, and the result."""
