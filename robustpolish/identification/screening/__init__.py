"""Effects that might be missing: where they could act, and what the data say before any fit."""
