"""What the subcommands share: progress, JSON, errors and exit codes."""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import click

from robustpolish.errors import InvalidInputError, RobustPolishError
from robustpolish.long_calls import someone_looks, working
from robustpolish.saved_file import plain
from robustpolish.saving import check_new_file, write_file

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


brush_options = options(
    click.option(
        "--run", type=click.IntRange(1, 4), default=1, show_default=True, help="Table 9.2."
    ),
    choice(
        "--simulator",
        ("physical", "listing"),
        "Well-posed contact, or the thesis's listing with its defects.",
    ),
    click.option("--duration", default=5.0, show_default=True, help="Seconds."),
)
"""What a run of the brush needs."""


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


result_options = options(
    click.option(
        "--json",
        "json_out",
        is_flag=False,
        flag_value="-",
        metavar="[FILE]",
        help="Write the result as JSON to FILE, or to standard output.",
    ),
    click.option("--force", is_flag=True, help="Replace existing results."),
    reports_errors,
)
"""How a command gives its result, or an error."""


PICTURES = (".png", ".svg", ".pdf")
"""How the names of pictures end."""


def check_json(json_out: str | None, force: bool) -> None:
    """Refuse a file for JSON that could not be written, before anything is computed."""
    if json_out not in (None, "-"):
        check_new_file(json_out, force)


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
    with working(what, stages=True) as tell:
        yield (lambda name: tell(name.removesuffix(" ..."))) if someone_looks() else _line


def _line(name: str) -> None:
    click.echo(name if name.endswith(" ...") else f"... {name}", err=True)


def show(content: Mapping[str, Any], text: str, json_out: str | None, force: bool = False) -> None:
    """Print a result as text, or as JSON for "-"; for a file name, write the JSON there too."""
    if json_out == "-":
        click.echo(to_json(content))
        return
    if json_out is not None:
        write_file(json_out, to_json(content) + "\n", force)
    click.echo(text)


def to_json(content: Mapping[str, Any]) -> str:
    """Return strict JSON: arrays as lists, infinities as strings, NaN as null."""
    return json.dumps(plain(content, nan=None), indent=2, allow_nan=False, default=_complex)


def _complex(value: complex) -> dict[str, Any]:
    """Return the parts of a complex number, the one kind of value that JSON does not know."""
    return plain({"real": value.real, "imag": value.imag}, nan=None)
