"""`robustpolish norms`."""

from __future__ import annotations

import click
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.cli.machine import READINGS, machine_options
from robustpolish.cli.options import result_options, show
from robustpolish.models import air_bearing


@click.command()
@machine_options
@result_options
def norms(reading: str, dissipation: float, json_out: str | None, force: bool) -> None:
    """Show the H-infinity and H2 norms from the brush forces to the six displacements.

    Nothing is controlled; the norms are what a controller has to reduce.
    """
    system = air_bearing(READINGS[reading](), dissipation).open_loop
    hinf, h2 = hinf_norm(system), h2_norm(system)
    peak_hz = hinf.frequency / (2 * np.pi)
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
    lines = (
        f"H-infinity  {hinf.value:.7g} m/N at {peak_hz:.6g} Hz",
        f"            certified between {hinf.lower:.10g} and {hinf.upper:.10g}",
        f"H2          {h2.value:.7g} m/N s^-1/2",
        *filter(None, (hinf.reason, h2.reason)),
    )
    show(content, "\n".join(lines), json_out, force)
