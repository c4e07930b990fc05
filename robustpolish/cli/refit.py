"""`robustpolish refit`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click

from robustpolish.cli.measurement import (
    Reading,
    data_argument,
    load_records,
    load_response,
    measurement_options,
    replaceable,
)
from robustpolish.cli.options import check_json, result_options, show, to_json
from robustpolish.identification import refit as refit_model
from robustpolish.measurements import holds_frequency_response
from robustpolish.models import MechanicalModel
from robustpolish.saving import new_file


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option("--save", type=click.Path(dir_okay=False), help="Save the fitted model (.toml).")
@measurement_options
@result_options
def refit(
    data: tuple[str, ...],
    model: str,
    save: str | None,
    reading: Reading,
    json_out: str | None,
    force: bool,
) -> None:
    """Fit the numbers of a model, those of its effects included.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    the numbers of the machine are common. Or it holds frequency responses (CSV with a column
    "frequency [Hz]", UFF 58). The exit code is 0 however well the model fits, and 2 for bad input.
    """
    replace = force or replaceable(json_out, *data, model)
    check_json(json_out, replace)
    loaded = MechanicalModel.from_toml(Path(model))
    if any(holds_frequency_response(path) for path in data):
        given = load_response(data, reading, {})
    else:
        given = load_records(data, loaded, reading)
    with ExitStack() as places:
        # The place is claimed first: nothing is computed that could not be saved.
        draft = None if save is None else places.enter_context(new_file(save, force, (".toml",)))
        result = refit_model(loaded, given)
        content = result.to_dict()
        to_json(content)  # nothing is written if anything fails
        if draft is not None:
            draft.write_text(result.model.to_toml(), encoding="utf-8")
    show(content, repr(result), json_out, replace)
