"""`robustpolish norms`."""

from __future__ import annotations

import click
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.cli.machine import READINGS, machine_options
from robustpolish.cli.options import force_option, json_option, reports_errors, write_json
from robustpolish.models import air_bearing


@click.command()
@machine_options
@json_option
@force_option
@reports_errors
def norms(reading: str, dissipation: float, json_out: str | None, force: bool) -> None:
    """Show the H-infinity and H2 norms from the brush forces to the six displacements.

    Nothing is controlled; the norms are what a controller has to reduce.
    """
    system = air_bearing(READINGS[reading](), dissipation).open_loop
    hinf, h2 = hinf_norm(system), h2_norm(system)
    peak_hz = hinf.frequency / (2 * np.pi)
    if json_out is not None:
        content = {
            "hinf": {
                "value": hinf.value,
                "lower": hinf.lower,
                "upper": hinf.upper,
                "frequency_hz": peak_hz,
                "reason": hinf.reason,
            },
            "h2": {"value": h2.value, "reason": h2.reason},
            "unit": {"hinf": "m/N", "h2": "m/N s^-0.5"},
        }
        write_json(content, json_out, force)
    if json_out != "-":
        click.echo(f"H-infinity  {hinf.value:.7g} m/N at {peak_hz:.6g} Hz")
        click.echo(f"            certified between {hinf.lower:.10g} and {hinf.upper:.10g}")
        click.echo(f"H2          {h2.value:.7g} m/N s^-1/2")
        for reason in filter(None, (hinf.reason, h2.reason)):
            click.echo(reason)
