"""Command line, design tasks from files, and reports."""
