"""What came out: diagnosis, refit and ledger, in words, pictures and files."""
