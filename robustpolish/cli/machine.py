"""The options that choose the machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from robustpolish.models import AirBearingParameters

F = TypeVar("F", bound=Callable[..., Any])

READINGS = {
    "published": AirBearingParameters.as_published,
    "printed": AirBearingParameters.as_printed,
    "corrected": AirBearingParameters.corrected,
}


def machine_options(command: F) -> F:
    """Add --parameters and --dissipation."""
    command = click.option(
        "--dissipation",
        type=float,
        default=0.001,
        show_default=True,
        help="Share of the energy lost per cycle, n in (8.23).",
    )(command)
    return click.option(
        "--parameters",
        "reading",
        type=click.Choice(list(READINGS)),
        default="published",
        show_default=True,
        help="Reading of the thesis: the published numbers, table 9.1 as printed, or the "
        "physically right inertia.",
    )(command)
