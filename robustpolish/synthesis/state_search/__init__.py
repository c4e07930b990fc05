"""The search for a state feedback, part by part."""
