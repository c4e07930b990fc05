"""`robustpolish modes` for any machine."""

from __future__ import annotations

from dataclasses import asdict

import click

from robustpolish.analysis import modes as modes_of
from robustpolish.cli.any_machine.options import machine_options, named_machine
from robustpolish.cli.options import check_json, result_options, show
from robustpolish.models import MechanicalModel


@click.command("modes")
@machine_options
@result_options
def machine_modes(model: str | None, plant: str | None, json_out: str | None, force: bool) -> None:
    """Show natural frequencies, damping ratios and the state that carries each mode.

    Effects of a mechanical model are linearised about the state of rest.
    """
    check_json(json_out, force)
    machine = named_machine(model, plant)
    given = machine.linearize() if isinstance(machine, MechanicalModel) else machine
    found = modes_of(given.open_loop)
    show({"modes": [asdict(mode) for mode in found]}, str(found), json_out, force)
