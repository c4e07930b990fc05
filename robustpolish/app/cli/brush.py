"""`robustpolish brush`."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import click
import numpy as np

from robustpolish.app.cli import options
from robustpolish.base.atomic_writes import new_file
from robustpolish.polishing.air_bearing import FORCES
from robustpolish.polishing.coupled_loops import brush_record
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.mould import Mould
from robustpolish.polishing.tool_path import ToolPath

_THERE = click.Path(exists=True, dir_okay=False)
_MOULD = "an .stl mesh, or a .csv grid of heights."
_MODEL = (
    "Record what sensors on a machine measure that carries the brush: a TOML file, or air-bearing."
)
_PATH = "a .csv file with columns x, y and perhaps t."


@click.command()
@options.brush_options
@options.option("--mould", f"What is polished instead of the trough: {_MOULD}", _THERE)
@options.option("--path", f"Where the tool goes instead of circling: {_PATH}", _THERE)
@options.option("--unit", "Of the files of mould and path.", click.Choice(["m", "mm", "um"]), "mm")
@options.option("--speed", "In m/s along the mould, of a path without times.", float)
@options.option("--model", _MODEL, click.Path())
@options.option(
    "--sensors", "Of the model's outputs, with --model.", default="x,y,z", metavar="X,Y"
)
@options.option("--noise", "Of a sensor, in m, with --model; 20 nm by default.", float)
@options.option("--seed", "Of that noise.", default=0)
@options.option("--out", "Save all signals: a .csv or .nc (netCDF) file.", options.FILE)
@options.result_options
def brush(
    run: int, simulator: Any, duration: float, mould: str | None, path: str | None, unit: Any,
    speed: float | None, model: str | None, sensors: str, noise: float | None, seed: int,
    out: str | None, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Simulate the brush on its mould and show the forces with which it disturbs the tool."""
    machine = None if model is None else options.mechanical_model(model)
    with ExitStack() as places:
        # The place is claimed first: nothing is simulated that could not be saved.
        draft = places.enter_context(new_file(out, force, (".csv", ".nc"))) if out else None
        surface = None
        if mould is not None:
            read = Mould.from_csv if mould.lower().endswith(".csv") else Mould.from_stl
            surface = read(mould, unit=unit)
        course = ToolPath.from_csv(path, unit=unit, speed=speed, over=surface) if path else None
        tell = places.enter_context(options.stages("Polishing"))
        tell(f"Simulating {duration:g} s of run {run} ({simulator}) ...")
        signals = simulate_brush(simulator, run, duration, surface=surface, path=course)
        if machine is not None:
            tell("Recording the machine ...")
            signals = brush_record(
                signals, machine, sensors=options.split_names(sensors), noise=noise, seed=seed
            )
        if draft is not None and draft.suffix == ".csv":
            over_time = [name for name in signals.data_vars if signals[name].dims == ("time",)]
            units = {name: f"{name} [{signals[name].attrs['units']}]" for name in over_time}
            table = signals[over_time].to_dataframe()
            table.rename(columns=units if machine is not None else {}).to_csv(draft)
        elif draft is not None:
            signals.to_netcdf(draft)
    forces, lines = {}, [f"{'':6}{'largest [N]':>14}{'mean [N]':>14}{'impulse [N s]':>16}"]
    for name in FORCES if machine is None else machine.input_names:
        largest, mean = float(np.abs(signals[name]).max()), float(signals[name].mean())
        impulse = float(signals[name].integrate("time"))
        forces[name] = {"largest": largest, "mean": mean, "impulse": impulse}
        lines.append(f"{name:6}{largest:14.5g}{mean:14.5g}{impulse:16.5g}")
    content = {"forces": forces, "run": run, "simulator": simulator}
    return content, "\n".join(lines), out
