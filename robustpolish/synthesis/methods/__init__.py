"""The public synthesis methods: one signature and driver per file."""
