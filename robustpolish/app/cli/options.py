"""Options, results, exit codes and progress, which the subcommands share."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click
import xarray as xr

from robustpolish.base.atomic_writes import check_new_file, new_file, new_folder, write_file
from robustpolish.base.budget import is_interactive, progress_bar
from robustpolish.base.checks import described, invalid, one_of
from robustpolish.base.saved import plain
from robustpolish.errors import InvalidInputError, RobustPolishError
from robustpolish.identification.record import read_channels
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing_model
from robustpolish.signals.frequency_response import read_frequency_response

F = TypeVar("F", bound=Callable[..., Any])


def options(*several: Callable[[F], F]) -> Callable[[F], F]:
    """Return several decorators as one; the help shows options in this order."""

    def decorated(command: F) -> F:
        for decorator in reversed(several):
            command = decorator(command)
        return command

    return decorated


def choice(name: str, values: Sequence[str], what: str | None = None) -> Callable[[F], F]:
    """Return an option that takes one of several words, the first by default."""
    kind = click.Choice(values)
    return click.option(name, type=kind, default=values[0], show_default=True, help=what)


def option(
    names: str, what: str, kind: Any = None, default: Any = None, **more: Any
) -> Callable[[F], F]:
    """Return an option by its names with a space between; a default is shown."""
    if default is not None:
        more |= {"default": default, "show_default": True}
    return click.option(*names.split(), type=kind, help=what, **more)


def repeatable(names: str, form: str, what: str) -> Callable[[F], F]:
    """Return an option that may stand several times, each in a form such as OLD=NEW."""
    return option(names, what, multiple=True, metavar=form)


FILE = click.Path(dir_okay=False)

_WELL_POSED = "Well-posed contact, or the thesis's listing with its defects."
brush_options = options(
    option("--run", "Table 9.2.", click.IntRange(1, 4), 1),
    choice("--simulator", ("physical", "listing"), _WELL_POSED),
    option("--duration", "Seconds.", default=5.0),
)
"""What a run of the brush needs."""


@contextmanager
def errors_to_exit_codes() -> Iterator[None]:
    """Turn the package's errors into a message and an exit code.

    2 means bad input, 1 that no certified answer was found or none exists; anything else is a
    defect of the program and keeps its traceback.
    """
    try:
        yield
    except RobustPolishError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(2 if isinstance(error, InvalidInputError) else 1)


def _printed(command: F) -> F:
    """Print what a command returns: its result as plain values, as text, and what was saved.

    A file for JSON or a picture that could not be written is refused before anything is computed.
    A command that reads a measurement may replace the JSON of an earlier run.
    """

    @functools.wraps(command)
    def wrapped(*, json_out: str | None, force: bool, **given: Any) -> None:
        with errors_to_exit_codes():
            replace = force or ("data" in given and replaceable(json_out, *_inputs(given)))
            if json_out not in (None, "-"):
                check_new_file(json_out, replace)
            if given.get("plot") is not None:
                check_new_file(given["plot"], force, PICTURES)
            content, text, *places = command(force=force, **given)
            print_result(content, text, json_out, replace)
            for place in filter(None, places):
                click.echo(f"Saved {place}", err=True)

    return wrapped  # type: ignore[return-value]


def _inputs(given: Mapping[str, Any]) -> list[str]:
    """Return the files that a command reads."""
    found = [given.get(name) or () for name in ("data", "model", "machines")]
    return [path for one in found for path in ((one,) if isinstance(one, str) else one)]


_TO_JSON = "Write the result as JSON to FILE, or to standard output."
result_options = options(
    option("--json json_out", _TO_JSON, is_flag=False, flag_value="-", metavar="[FILE]"),
    option("--force", "Replace existing results.", is_flag=True),
    _printed,
)
"""How a command gives its result, or an error."""


PICTURES = (".png", ".svg", ".pdf")
"""How the names of pictures end."""


def save_picture(path: str | None, force: bool, draw: Callable[[], Any]) -> None:
    """Save the figure that `draw` makes, if a path was given."""
    if path is not None:
        import matplotlib.pyplot as plt  # most commands draw nothing

        with new_file(path, force, PICTURES) as draft:
            figure = draw()
            figure.savefig(draft, dpi=150)
            plt.close(figure)


def place_options(folder: str) -> Callable[[F], F]:
    """Add --out, a folder for what `folder` says, and --report."""
    report = "Write an HTML report to FILE, or to report.html in the folder."
    return options(
        option("--out", folder, click.Path(file_okay=False)),
        option("--report", report, is_flag=False, flag_value="", metavar="[FILE]"),
    )


@contextmanager
def claimed_places(
    out: str | None, report: str | None, force: bool
) -> Iterator[tuple[Path | None, Path | None]]:
    """Claim the folder and the report first: no result is computed that could not be saved.

    Yields
    ------
    (Path or None, Path or None)
        Where to write the files of the folder, and the report.
    """
    with ExitStack() as places:
        folder = places.enter_context(new_folder(out, force)) if out else None
        page = places.enter_context(new_file(report, force, (".html",))) if report else None
        yield folder, folder / "report.html" if folder and report == "" else page


@contextmanager
def stages(what: str) -> Iterator[Callable[[str], None]]:
    """Name the stages of a command: in one bar on a terminal, elsewhere by a line for each.

    Parameters
    ----------
    what : str
        What the command does, such as "Designing".

    Yields
    ------
    callable
        Takes the name of the stage that begins. Long calls of the package name theirs by
        themselves, in the bar only.

    Examples
    --------
    >>> with stages("Polishing") as tell:
    ...     tell("first coat")
    """
    with progress_bar(what, stages=True) as tell:

        def show_stage(name: str) -> None:
            if is_interactive():
                tell(name.removesuffix(" ..."))
            else:
                click.echo(name if name.endswith(" ...") else f"... {name}", err=True)

        yield show_stage


def print_result(
    content: Mapping[str, Any], text: str, json_out: str | None, force: bool = False
) -> None:
    """Print a result as text, or as JSON for "-"; for a file name, write the JSON there too."""
    if json_out == "-":
        click.echo(to_json(content))
        return
    if json_out is not None:
        write_file(json_out, to_json(content) + "\n", force)
    click.echo(text)


def to_json(content: Mapping[str, Any]) -> str:
    """Return strict JSON: arrays as lists, infinities as strings, NaN as null."""

    def parts(value: complex) -> dict[str, Any]:
        """Return a complex number, the one kind of value that JSON does not know."""
        return plain({"real": value.real, "imag": value.imag}, nan=None)

    return json.dumps(plain(content, nan=None), indent=2, allow_nan=False, default=parts)


# The options that choose the machine.

READINGS = {
    "published": AirBearingParameters.as_published,
    "printed": AirBearingParameters.as_printed,
    "corrected": AirBearingParameters.corrected,
}


_READING = (
    "Reading of the thesis: the published numbers, table 9.1 as printed, or the physically right "
    "inertia."
)
machine_options = options(
    option("--parameters reading", _READING, click.Choice(list(READINGS)), "published"),
    option("--dissipation", "Share of the energy lost per cycle, n in (8.23).", float, 0.001),
)
"""Which machine: --parameters and --dissipation."""


def named_source(given: str) -> Path | MechanicalModel:
    """Return the file of a model, whose lines messages name, or the air bearing."""
    path = Path(given)
    return path if path.suffix == ".toml" else mechanical_model(given)


def mechanical_model(given: str) -> MechanicalModel:
    """Return a model by its TOML file, or the ``air-bearing``, ``air-bearing:as-printed``."""
    name, _, reading = given.partition(":")
    if name != "air-bearing":
        return MechanicalModel.from_toml(Path(given))
    reading = reading.removeprefix("as-") or "published"
    if reading not in READINGS:
        wanted = f"air-bearing:as-{', '.join(READINGS)}"
        raise invalid("--model", given, wanted, "Take one of these readings of the thesis.")
    return air_bearing_model(READINGS[reading]())


# Options of the subcommands that read a measurement.


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
    columns : str or None
        Outputs that are read, as in ``x,y``; the inputs always are.
    units, renames : tuple of str
        As in ``x=mm`` and ``old=new``.
    """

    table: str | None = None
    time: str | None = None
    sampling_rate: float | None = None
    between: tuple[float, float] | None = None
    max_bytes: float | None = None
    columns: str | None = None
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


_COLUMNS = "Outputs to use; by default those of the model that DATA holds."
_PART = "Part to read, in seconds, of each file."
_options = options(
    option("--table", "Matrix or group of a file that holds several."),
    option("--time", "Column that holds the time.", metavar="NAME"),
    option("--sampling-rate", "In Hz, for files without time.", float),
    option("--between", _PART, (float, float), metavar="START END"),
    option("--columns", _COLUMNS, metavar="X,Y"),
    option("--max-bytes", "Read files up to this size; 1e9 by default.", float),
    repeatable("--rename renames", "OLD=NEW", "Call a column as the model does; repeatable."),
    repeatable("--unit units", "COLUMN=UNIT", "As in x=mm; repeatable."),
)


_OF_TABLE = ("table", "time", "sampling_rate", "between")
_OVER_TIME = (*_OF_TABLE, "columns")
"""Options that mean something for records over time only."""


def load_data(path: str, model: MechanicalModel, reading: Reading) -> xr.Dataset:
    """Read the columns that a model needs."""
    outputs = None
    if reading.columns is not None:
        asked = split_names(reading.columns)
        for name in asked:
            one_of("--columns", name, (*model.input_names, *model.output_names))
        outputs = [name for name in model.output_names if name in asked]
    return read_channels(model, path, outputs, **read_as(reading))


def read_as(reading: Reading) -> dict[str, Any]:
    """Return the arguments of :func:`robustpolish.read_measurement` but for the columns."""
    return {
        "units": pairs("--unit", reading.units, "COLUMN=UNIT", "--unit x=mm"),
        "rename": _renames(reading),
        **{name: getattr(reading, name) for name in (*_OF_TABLE, "max_bytes")},
    }


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
    over_time = {"--" + name.replace("_", "-"): getattr(reading, name) for name in _OVER_TIME}
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
    response = read_frequency_response(paths[0], units=in_file, max_bytes=reading.max_bytes)
    ends = {end: [str(name) for name in response[end].values] for end in ("output", "input")}
    outputs, inputs = ends.values()
    for old in renames:
        if (old in outputs) == (old in inputs):
            listed = f"an output ({', '.join(outputs)}) or an input ({', '.join(inputs)}), not both"
            remedy = "Check the file, or read it in Python with outputs= and inputs=."
            raise invalid("--rename", old, listed, remedy)
    new: dict[str, Any] = {
        f"{end}s": {old: new for old, new in renames.items() if old in names}
        for end, names in ends.items()
    }
    return read_frequency_response(response, **new)


def _renames(reading: Reading) -> dict[str, str]:
    return pairs("--rename", reading.renames, "OLD=NEW", "--rename force=F")


def split_names(text: str) -> list[str]:
    """Take ``a, b`` apart."""
    return [name.strip() for name in text.split(",")]


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
