"""Where the error of a comparison is: shares, tests, restoring-force surfaces, words."""
