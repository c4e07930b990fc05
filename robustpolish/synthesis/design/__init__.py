"""What every synthesis returns, and its file."""
