"""`robustpolish simulate`."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click
import numpy as np

from robustpolish.app.cli import options as cli
from robustpolish.base.atomic_writes import new_file
from robustpolish.base.checks import described, invalid
from robustpolish.closed_loop.simulate import simulate as simulate_loop
from robustpolish.loading import load as load_saved
from robustpolish.plots.time import plot_time_series
from robustpolish.signals.read import read_measurement

_CONTROLLER = (
    "A sampled design that was saved (.json); repeatable. By default the model's feedback."
)
_REFERENCE = "Columns of DATA that outputs of the same names shall follow, under a --controller."


@click.command()
@click.argument("data", type=click.Path())
@cli.option(
    "--model", "Mechanical model: a TOML file, or air-bearing.", click.Path(), required=True
)
@cli.repeatable("--controller controllers", "FILE", _CONTROLLER)
@cli.option("--reference", _REFERENCE, metavar="X,Y")
@cli.option("--out", "Save the signals of the last controller (.csv).", cli.FILE)
@cli.option("--plot", "Save the picture of the first output (.png, .svg).", cli.FILE)
@cli.result_options
def simulate(
    data: str, model: str, controllers: tuple[str, ...], reference: str | None, out: str | None,
    plot: str | None, force: bool,
) -> tuple[Any, ...]:  # fmt: skip
    """Simulate a machine, its effects included, with the sampled controller that runs it.

    DATA is a file with what drives it over time: inputs of the model, and references. Controllers
    run with their delay, hold, converters and limits.
    """
    machine, given = cli.mechanical_model(model), read_measurement(data)
    asked = [] if reference is None else cli.split_names(reference)
    for name in asked:
        if name not in given or name not in machine.output_names:
            shown, want = described(repr(name)), "an output of the model, and a column of DATA"
            raise invalid("--reference", shown, want, "Correct the name.")
    wanted = given[asked] if asked else None
    known: dict[str, Any] = {Path(path).stem: load_saved(path) for path in controllers}
    known = known or {"": None}
    with new_file(out, force, (".csv",)) if out is not None else nullcontext() as draft:
        runs = {n: simulate_loop(machine, c, given, wanted) for n, c in known.items()}
        if draft is not None:
            list(runs.values())[-1].to_dataframe().to_csv(draft)
    content: dict[str, Any] = {}
    lines = [f"{'':24}{'largest':>12}{'RMS':>12}{'at a limit':>12}"]
    for name, run in runs.items():
        lines += [name] * bool(name)
        content[name or "feedback"] = figures = {}
        for signal, column in run.data_vars.items():
            error = column.values - (
                given[signal].interp(time=run.time).values if signal in asked else 0
            )
            size, rms = float(np.max(np.abs(error))), float(np.sqrt(np.mean(error**2)))
            what = f"{signal}{' error' * (signal in asked)} [{column.attrs.get('units', '')}]"
            share = column.attrs.get("at_limit")
            figures[signal] = {"largest": size, "rms": rms, "at_limit": share}
            ends = "" if share is None else f"{100 * share:11.3g}%"
            lines.append(f"  {what:22}{size:12.5g}{rms:12.5g}{ends}")
    first = machine.output_names[0]
    cli.save_picture(
        plot,
        force,
        lambda: plot_time_series({n or first: r[first] for n, r in runs.items()}).figure,
    )
    return content, "\n".join(lines), out
