"""What an engineer would say at a glance about a record, a model and a fit."""
