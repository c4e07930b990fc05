"""`robustpolish norms`."""

from __future__ import annotations

import click

from robustpolish.cli.any_machine.either import or_any_machine
from robustpolish.cli.any_machine.norms import machine_norms, shown_norms
from robustpolish.cli.machine import READINGS, machine_options
from robustpolish.cli.options import check_json, result_options, show
from robustpolish.models import air_bearing


@click.command(cls=or_any_machine(machine_norms))
@machine_options
@result_options
def norms(reading: str, dissipation: float, json_out: str | None, force: bool) -> None:
    """Show the H-infinity and H2 norms from the brush forces to the six displacements.

    Nothing is controlled; the norms are what a controller has to reduce.
    """
    check_json(json_out, force)
    system = air_bearing(READINGS[reading](), dissipation).open_loop
    content, text = shown_norms(system, "m/N")
    show(content, text, json_out, force)
