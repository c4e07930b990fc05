"""The search for a controller of prescribed structure, part by part."""
