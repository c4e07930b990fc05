"""`robustpolish compare`."""

from __future__ import annotations

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
from robustpolish.cli.options import PICTURES, check_json, result_options, show, to_json
from robustpolish.identification import compare as compare_model
from robustpolish.identification import residual_analysis
from robustpolish.measurements import holds_frequency_response
from robustpolish.models import MechanicalModel
from robustpolish.saving import check_new_file, new_file


@click.command()
@data_argument
@click.option("--model", required=True, type=click.Path(), help="Mechanical model, a TOML file.")
@click.option("--window", type=float, help="Start anew after so many SECONDS: short free runs.")
@click.option("--horizon", type=float, help="Predict so many SECONDS ahead from the outputs.")
@measurement_options
@click.option("--residuals", is_flag=True, help="Show where the error is.")
@click.option("--plot", type=click.Path(dir_okay=False), help="Save the pictures (.png, .svg).")
@result_options
def compare(
    data: tuple[str, ...],
    model: str,
    window: float | None,
    horizon: float | None,
    reading: Reading,
    residuals: bool,
    plot: str | None,
    json_out: str | None,
    force: bool,
) -> None:
    """Simulate a model on measured inputs and compare it with the measured outputs.

    DATA is a measurement (CSV, MAT, HDF5, NPZ, WAV; TDMS and UFF with the extra [io]) with the
    model's inputs and outputs as columns, or several of them, to all of which the options apply:
    each is run by itself, and the error is told over all and of each. Or it holds frequency
    responses (CSV with a column "frequency [Hz]", UFF 58), which are compared with those of the
    model. The exit code is 0 however well the model fits, and 2 for bad input.
    """
    replace = force or replaceable(json_out, *data, model)
    check_json(json_out, replace)
    if plot is not None:
        check_new_file(plot, force, PICTURES)
    loaded = MechanicalModel.from_toml(Path(model))
    if any(holds_frequency_response(path) for path in data):
        given = {"--window": window, "--horizon": horizon, "--residuals": residuals or None}
        result = compare_model(loaded, load_response(data, reading, given))
        content, lines = result.to_dict(), [repr(result)]
    else:
        records = load_records(data, loaded, reading)
        result = compare_model(loaded, records, window=window, horizon=horizon)
        content = result.to_dict()
        lines = [repr(result), *(f"  {note}" for note in result.data.attrs["notes"])]
        if residuals:
            analysis = residual_analysis(result)
            content["residuals"] = analysis.to_dict()
            lines.append(analysis.explain())
    to_json(content)  # nothing is written if anything fails
    if plot is not None:
        with new_file(plot, force, PICTURES) as draft:
            result.plot_panels().savefig(draft, dpi=150)
    show(content, "\n".join(lines), json_out, replace)
