"""Machines as users write them, one a file."""

from pathlib import Path


def machine(name):
    """Return the text of a file of this folder."""
    return Path(__file__).with_name(f"{name}.toml").read_text("utf-8")
