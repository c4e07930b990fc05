"""`robustpolish norms` for any machine, and how norms are shown."""

from __future__ import annotations

from typing import Any

import click
import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.cli.any_machine.options import channel_options, machine_options, named_machine
from robustpolish.cli.options import check_json, result_options, show
from robustpolish.machine_design import machine_plant
from robustpolish.measurements import ratio_unit
from robustpolish.models import MechanicalModel


@click.command("norms")
@machine_options
@channel_options
@result_options
def machine_norms(
    model: str | None,
    plant: str | None,
    performance: tuple[str, ...],
    disturbance: tuple[str, ...],
    json_out: str | None,
    force: bool,
) -> None:
    """Show the H-infinity and H2 norms from disturbances to performance outputs, uncontrolled.

    Of a mechanical model all inputs disturb and all free coordinates are outputs, unless some are
    named; effects are linearised about the state of rest.
    """
    check_json(json_out, force)
    machine = named_machine(model, plant)
    pushed = machine.free if isinstance(machine, MechanicalModel) else ()
    given = machine_plant(machine, pushed, (), performance, disturbance)
    units = {
        ratio_unit(given.units.get(z, ""), given.units.get(w, ""))
        for z in given.performance_names
        for w in given.disturbance_names
    }
    content, text = shown_norms(given.open_loop, units.pop() if len(units) == 1 else "")
    names = f"from {', '.join(given.disturbance_names)} to {', '.join(given.performance_names)}"
    content |= {"disturbances": given.disturbance_names, "performance": given.performance_names}
    show(content, f"{names}\n{text}", json_out, force)


def shown_norms(system: control.StateSpace, unit: str) -> tuple[dict[str, Any], str]:
    """Return both norms of a system as plain values and as text."""
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
        "unit": {"hinf": unit, "h2": f"{unit} s^-0.5" if unit else ""},
    }
    own, squared = (f" {unit}", f" {unit} s^-1/2") if unit else ("", "")
    lines = (
        f"H-infinity  {hinf.value:.7g}{own} at {peak_hz:.6g} Hz",
        f"            certified between {hinf.lower:.10g} and {hinf.upper:.10g}",
        f"H2          {h2.value:.7g}{squared}",
        *filter(None, (hinf.reason, h2.reason)),
    )
    return content, "\n".join(lines)
