"""One kind of tunable block per file."""
