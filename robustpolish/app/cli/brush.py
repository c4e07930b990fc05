"""`robustpolish brush`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np
import xarray as xr

from robustpolish.app.cli.options import (
    brush_options,
    result_options,
    stages,
)
from robustpolish.base.atomic_writes import new_file
from robustpolish.polishing.air_bearing import FORCES
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.mould import Mould
from robustpolish.polishing.tool_path import ToolPath


@click.command()
@brush_options
@click.option(
    "--mould",
    type=click.Path(exists=True, dir_okay=False),
    help="What is polished instead of the trough: an .stl mesh, or a .csv grid of heights.",
)
@click.option(
    "--path",
    type=click.Path(exists=True, dir_okay=False),
    help="Where the tool goes instead of circling: a .csv file with columns x, y and perhaps t.",
)
@click.option(
    "--unit",
    type=click.Choice(["m", "mm", "um"]),
    default="mm",
    show_default=True,
    help="Of the files of mould and path.",
)
@click.option("--speed", type=float, help="In m/s along the mould, of a path without times.")
@click.option(
    "--out", type=click.Path(dir_okay=False), help="Save all signals: a .csv or .nc (netCDF) file."
)
@result_options
def brush(
    run: int,
    simulator: Literal["physical", "listing"],
    duration: float,
    mould: str | None,
    path: str | None,
    unit: Literal["m", "mm", "um"],
    speed: float | None,
    out: str | None,
    force: bool,
) -> tuple[Any, ...]:
    """Simulate the brush on its mould and show the forces with which it disturbs the tool."""
    with ExitStack() as places:
        # The place is claimed first: nothing is simulated that could not be saved.
        draft = places.enter_context(new_file(out, force, (".csv", ".nc"))) if out else None
        surface = None
        if mould is not None:
            read = Mould.from_csv if mould.lower().endswith(".csv") else Mould.from_stl
            surface = read(mould, unit=unit)
        course = ToolPath.from_csv(path, unit=unit, speed=speed, over=surface) if path else None
        tell = places.enter_context(stages("Polishing"))
        tell(f"Simulating {duration:g} s of run {run} ({simulator}) ...")
        signals = simulate_brush(simulator, run, duration, surface=surface, path=course)
        if draft is not None:
            _save(signals, draft)
    forces = {
        name: {
            "largest": float(np.abs(signals[name]).max()),
            "mean": float(signals[name].mean()),
            "impulse": float(signals[name].integrate("time")),
        }
        for name in FORCES
    }
    lines = [f"{'':6}{'largest [N]':>14}{'mean [N]':>14}{'impulse [N s]':>16}"]
    for name, found in forces.items():
        lines += [f"{name:6}{found['largest']:14.5g}{found['mean']:14.5g}{found['impulse']:16.5g}"]
    content = {"forces": forces, "run": run, "simulator": simulator}
    return content, "\n".join(lines), out


def _save(signals: xr.Dataset, path: Path) -> None:
    if path.suffix == ".csv":
        over_time = [name for name in signals.data_vars if signals[name].dims == ("time",)]
        signals[over_time].to_dataframe().to_csv(path)
    else:
        signals.to_netcdf(path)
