"""What the subcommands share: JSON, errors and exit codes."""

from __future__ import annotations

import functools
import json
import math
import sys
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click
import numpy as np

from robustpolish.errors import InvalidInputError, RobustPolishError
from robustpolish.saving import write_file

F = TypeVar("F", bound=Callable[..., Any])

json_option = click.option(
    "--json",
    "json_out",
    is_flag=False,
    flag_value="-",
    metavar="[FILE]",
    help="Write the result as JSON to FILE, or to standard output.",
)
force_option = click.option("--force", is_flag=True, help="Replace existing results.")


def brush_options(command: F) -> F:
    """Give a command the options of a run of the brush: --run, --simulator and --duration."""
    simulator = click.option(
        "--simulator",
        type=click.Choice(["physical", "listing"]),
        default="physical",
        show_default=True,
        help="Well-posed contact, or the thesis's listing with its defects.",
    )
    run = click.IntRange(1, 4)
    command = click.option("--duration", default=5.0, show_default=True, help="Seconds.")(command)
    command = simulator(command)
    return click.option("--run", type=run, default=1, show_default=True, help="Table 9.2.")(command)


def reports_errors(command: F) -> F:
    """Turn the package's errors into a message and an exit code.

    2 means bad input, 1 that no certified answer was found or none exists; anything else is a
    defect of the program and keeps its traceback.
    """

    @functools.wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        try:
            return command(*args, **kwargs)
        except InvalidInputError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(2)
        except RobustPolishError as error:
            click.echo(f"Error: {error}", err=True)
            sys.exit(1)

    return wrapped  # type: ignore[return-value]


def write_json(content: Mapping[str, Any], json_out: str, force: bool = False) -> None:
    """Write JSON to a file, or to standard output for "-"."""
    text = to_json(content)
    if json_out == "-":
        click.echo(text)
    else:
        write_file(json_out, text + "\n", force)


def to_json(content: Mapping[str, Any]) -> str:
    """Return strict JSON: arrays as lists, infinities as strings, NaN as null."""
    return json.dumps(_plain(content), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, complex):
        return {"real": _plain(value.real), "imag": _plain(value.imag)}
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return value
