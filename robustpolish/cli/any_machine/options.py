"""The options that name a machine and its signals."""

from __future__ import annotations

from pathlib import Path

import click

from robustpolish.cli.options import options
from robustpolish.models import GeneralizedPlant, MechanicalModel
from robustpolish.validation import described, invalid

machine_options = options(
    click.option("--model", type=click.Path(), help="Mechanical model, a TOML file."),
    click.option("--plant", type=click.Path(), help="Or a plant that was saved (.json)."),
)
"""Which machine: --model or --plant."""

channel_options = options(
    click.option("--performance", multiple=True, metavar="NAME", help="What is kept small."),
    click.option("--disturbance", multiple=True, metavar="NAME", help="What disturbs."),
)
"""From where to where: --disturbance and --performance, each repeatable."""


def named_machine(model: str | None, plant: str | None) -> MechanicalModel | GeneralizedPlant:
    """Return the machine in a file, which exactly one of two options names."""
    if model is not None and plant is not None:
        shown = described("--model and --plant")
        raise invalid("--plant", shown, "one of the two", "Leave one out.")
    if plant is not None:
        return GeneralizedPlant.load(plant)
    return MechanicalModel.from_toml(Path(model or ""))
