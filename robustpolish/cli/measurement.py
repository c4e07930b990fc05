"""Options of the subcommands that read a measurement."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
import xarray as xr

from robustpolish.cli.options import options
from robustpolish.measurements import read_frequency_response, read_measurement
from robustpolish.models import MechanicalModel
from robustpolish.validation import described, invalid

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
    max_bytes : float or None
        Largest size of a file, also of what it unpacks to.
    units, renames : tuple of str
        As in ``x=mm`` and ``old=new``.
    """

    table: str | None = None
    time: str | None = None
    sampling_rate: float | None = None
    between: tuple[float, float] | None = None
    max_bytes: float | None = None
    units: tuple[str, ...] = ()
    renames: tuple[str, ...] = ()


data_argument = click.argument("data", nargs=-1, required=True, type=click.Path())
"""One file with a measurement, or several."""


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
        "--between",
        type=(float, float),
        metavar="START END",
        help="Part to read, in seconds, of each file.",
    ),
    click.option("--max-bytes", type=float, help="Read files up to this size; 1e9 by default."),
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
        units=pairs("--unit", reading.units, "COLUMN=UNIT", "--unit x=mm"),
        time=reading.time,
        rename=_renames(reading),
        between=reading.between,
        sampling_rate=reading.sampling_rate,
        table=reading.table,
        max_bytes=reading.max_bytes,
    )


def load_records(
    paths: Sequence[str], model: MechanicalModel, reading: Reading
) -> dict[str, xr.Dataset]:
    """Read the columns that a model needs from one file or several, read alike.

    They go by the names of the files, with their folders where the names alone are not clear.
    """
    stems = [Path(path).stem for path in paths]
    names = stems if len(set(stems)) == len(stems) else paths
    if len(set(paths)) < len(paths):
        twice = next(path for path in paths if paths.count(path) > 1)
        remedy = "Leave the second one out."
        raise invalid("DATA", described(f"{twice} twice"), "each file once", remedy)
    return {name: load_data(path, model, reading) for name, path in zip(names, paths, strict=True)}


def load_response(paths: Sequence[str], reading: Reading, given: Mapping[str, Any]) -> xr.DataArray:
    """Read frequency responses; options that mean nothing for them are refused.

    Units are those of pairs, as in ``x/F=um/N``, by the new names as for records. `given` holds
    further options of the command that need a record; None where nothing was said.
    """
    if len(paths) > 1:
        shown = described(f"{len(paths)} files, one of them with frequency responses")
        remedy = "Compare frequency responses one file at a time."
        raise invalid("DATA", shown, "records over time, or one file with responses", remedy)
    path = paths[0]
    over_time = {
        "--table": reading.table,
        "--time": reading.time,
        "--sampling-rate": reading.sampling_rate,
        "--between": reading.between,
    }
    for option, value in {**given, **over_time}.items():
        if value is not None:
            shown = described(f"{value} for frequency responses")
            raise invalid(option, shown, "a record over time", "Leave it out.")
    units = pairs("--unit", reading.units, "OUTPUT/INPUT=UNIT", "--unit x/F=um/N")
    renames = _renames(reading)
    before = {new: old for old, new in renames.items()}
    in_file = {
        "/".join(before.get(end, end) for end in pair.split("/", 1)): unit
        for pair, unit in units.items()
    }
    response = read_frequency_response(path, units=in_file, max_bytes=reading.max_bytes)
    outputs, inputs = ([str(name) for name in response[end].values] for end in ("output", "input"))
    for old in renames:
        if (old in outputs) == (old in inputs):
            listed = f"an output ({', '.join(outputs)}) or an input ({', '.join(inputs)}), not both"
            remedy = "Check the file, or read it in Python with outputs= and inputs=."
            raise invalid("--rename", old, listed, remedy)
    return read_frequency_response(
        response,
        outputs={old: new for old, new in renames.items() if old in outputs},
        inputs={old: new for old, new in renames.items() if old in inputs},
    )


def _renames(reading: Reading) -> dict[str, str]:
    return pairs("--rename", reading.renames, "OLD=NEW", "--rename force=F")


def pairs(option: str, items: tuple[str, ...], form: str, example: str) -> dict[str, str]:
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
