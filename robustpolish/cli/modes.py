"""`robustpolish modes`."""

from __future__ import annotations

from dataclasses import asdict

import click

from robustpolish.analysis import modes as modes_of
from robustpolish.cli.any_machine.either import or_any_machine
from robustpolish.cli.any_machine.modes import machine_modes
from robustpolish.cli.machine import READINGS, machine_options
from robustpolish.cli.options import check_json, result_options, show
from robustpolish.models import air_bearing


@click.command(cls=or_any_machine(machine_modes))
@machine_options
@result_options
def modes(reading: str, dissipation: float, json_out: str | None, force: bool) -> None:
    """Show natural frequencies, damping ratios and the state that carries each mode."""
    check_json(json_out, force)
    found = modes_of(air_bearing(READINGS[reading](), dissipation).open_loop)
    show({"modes": [asdict(mode) for mode in found]}, str(found), json_out, force)
