"""Options of the subcommands that read a measurement."""

from __future__ import annotations

from pathlib import Path

import click
import xarray as xr

from robustpolish.cli.options import options
from robustpolish.measurements import read_measurement
from robustpolish.models import MechanicalModel
from robustpolish.validation import invalid

measurement_options = options(
    click.option("--table", help="Matrix or group of a file that holds several."),
    click.option("--sampling-rate", type=float, help="In Hz, for files without time."),
    click.option("--unit", "units", multiple=True, metavar="COLUMN=UNIT", help="As in x=mm."),
)
"""What reading a measurement needs beside its path."""


def load_data(
    path: str,
    model: MechanicalModel,
    table: str | None,
    sampling_rate: float | None,
    units: tuple[str, ...],
) -> xr.Dataset:
    """Read the columns that a model needs."""
    given = {}
    for item in units:
        name, equals, unit = item.partition("=")
        if not equals:
            raise invalid("--unit", item, "COLUMN=UNIT", "Write, for instance, --unit x=mm.")
        given[name] = unit
    return read_measurement(
        path,
        columns=[*model.input_names, *model.output_names],
        units=given,
        sampling_rate=sampling_rate,
        table=table,
    )


def replaceable(target: str | None, *sources: str) -> bool:
    """Whether an existing file may be replaced: JSON from an earlier run, never an input."""
    path = Path(target or "")
    used = [Path(source).resolve() for source in sources]
    return path.suffix == ".json" and path.resolve() not in used
