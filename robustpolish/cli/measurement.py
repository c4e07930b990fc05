"""Options of the subcommands that read a measurement."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
import xarray as xr

from robustpolish.cli.options import options
from robustpolish.measurements import read_measurement
from robustpolish.models import MechanicalModel
from robustpolish.validation import invalid

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Reading:
    """How a measurement is to be read, as said on the command line.

    Attributes
    ----------
    table, time : str or None
    sampling_rate : float or None
        In Hz.
    between : (float, float) or None
        In s.
    units, renames : tuple of str
        As in ``x=mm`` and ``old=new``.
    """

    table: str | None = None
    time: str | None = None
    sampling_rate: float | None = None
    between: tuple[float, float] | None = None
    units: tuple[str, ...] = ()
    renames: tuple[str, ...] = ()


def measurement_options(command: F) -> F:
    """Add what reading a measurement needs beside its path; the command gets one `reading`."""

    @functools.wraps(command)
    def gathered(*args: Any, **kwargs: Any) -> Any:
        reading = Reading(**{name: kwargs.pop(name) for name in Reading.__dataclass_fields__})
        return command(*args, reading=reading, **kwargs)

    return _options(gathered)  # type: ignore[return-value]


_options = options(
    click.option("--table", help="Matrix or group of a file that holds several."),
    click.option("--time", metavar="NAME", help="Column that holds the time."),
    click.option("--sampling-rate", type=float, help="In Hz, for files without time."),
    click.option(
        "--between", type=(float, float), metavar="START END", help="Part to read, in seconds."
    ),
    click.option(
        "--rename",
        "renames",
        multiple=True,
        metavar="OLD=NEW",
        help="Call a column as the model does; repeatable.",
    ),
    click.option(
        "--unit", "units", multiple=True, metavar="COLUMN=UNIT", help="As in x=mm; repeatable."
    ),
)


def load_data(path: str, model: MechanicalModel, reading: Reading) -> xr.Dataset:
    """Read the columns that a model needs."""
    return read_measurement(
        path,
        columns=[*model.input_names, *model.output_names],
        units=_pairs("--unit", reading.units, "COLUMN=UNIT", "--unit x=mm"),
        time=reading.time,
        rename=_pairs("--rename", reading.renames, "OLD=NEW", "--rename force=F"),
        between=reading.between,
        sampling_rate=reading.sampling_rate,
        table=reading.table,
    )


def _pairs(option: str, items: tuple[str, ...], form: str, example: str) -> dict[str, str]:
    """Take ``a=b`` apart; a name may hold an equals sign itself, what it gets may not."""
    given = {}
    for item in items:
        name, equals, value = item.rpartition("=")
        if not equals or not name:
            raise invalid(option, item, form, f"Write, for instance, {example}.")
        given[name] = value
    return given


def replaceable(target: str | None, *sources: str) -> bool:
    """Whether an existing file may be replaced: JSON from an earlier run, never an input."""
    path = Path(target or "")
    used = [Path(source).resolve() for source in sources]
    return path.suffix == ".json" and path.resolve() not in used
