"""The options that choose the machine."""

from __future__ import annotations

import click

from robustpolish.cli.options import options
from robustpolish.models import AirBearingParameters

READINGS = {
    "published": AirBearingParameters.as_published,
    "printed": AirBearingParameters.as_printed,
    "corrected": AirBearingParameters.corrected,
}


machine_options = options(
    click.option(
        "--parameters",
        "reading",
        type=click.Choice(list(READINGS)),
        default="published",
        show_default=True,
        help="Reading of the thesis: the published numbers, table 9.1 as printed, or the "
        "physically right inertia.",
    ),
    click.option(
        "--dissipation",
        type=float,
        default=0.001,
        show_default=True,
        help="Share of the energy lost per cycle, n in (8.23).",
    ),
)
"""Which machine: --parameters and --dissipation."""
