"""Tables of results as text and HTML, numbers with their errors, and SI prefixes."""

from __future__ import annotations

import html
import math
import re
import tomllib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

# Tables of words in TOML and templates in jinja, stored beside the modules that use them.


if TYPE_CHECKING:
    import jinja2


def tables(module: str, name: str = "words.toml") -> dict[str, Any]:
    """Return the tables of a TOML file in the folder of a module, whose ``__file__`` is given."""
    return tomllib.loads(Path(module).with_name(name).read_text("utf-8"))


def templates(
    package: str, filters: Mapping[str, Callable[..., Any]], **options: Any
) -> jinja2.Environment:
    """Return the templates in a package's folder; `filters` are added to ``f`` and ``g``.

    ``f`` writes a number with fixed decimals, ``g`` with significant digits.
    """
    import jinja2  # it takes a while, and only words need it

    folder = resources.files(package)
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: folder.joinpath(name).read_text("utf-8")),
        autoescape=jinja2.select_autoescape(),
        undefined=jinja2.StrictUndefined,
        **options,
    )
    environment.filters |= {
        "f": lambda value, digits: f"{value:.{digits}f}",
        "g": lambda value, digits=6: f"{value:.{digits}g}",
        **filters,
    }
    return environment


def paragraphs(template: jinja2.Template, block: str, **values: Any) -> tuple[str, ...]:
    """Return the paragraphs of a block, which blank lines part, with values filled in."""
    text = "".join(template.blocks[block](template.new_context(values)))
    return tuple(" ".join(part.split()) for part in re.split(r"\n\s*\n", text) if part.strip())


# How results show themselves: aligned text in a terminal, an HTML table in a notebook.


@dataclass(frozen=True, eq=False)
class Table:
    """A table that does not care where it is shown.

    Attributes
    ----------
    caption : str
    columns : tuple of str
        Names with units; none at all for a list of quantities.
    rows : tuple of tuples
        Numbers stay numbers, so that a report can sort them.
    digits : int
        Significant digits of floats.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    digits: int = 4

    def cells(self, missing: str = "-") -> list[list[str]]:
        """Return the rows as text.

        Parameters
        ----------
        missing : str, optional
            What stands where there is nothing.

        Returns
        -------
        list of list of str
        """
        return [[shown(cell, self.digits, missing) for cell in row] for row in self.rows]

    def numeric(self) -> list[bool]:
        """Tell which columns hold nothing but numbers: these are set flush right."""
        columns = zip(*self.rows, strict=True)
        return [all(_is_number(cell) for cell in column) for column in columns]


@dataclass(frozen=True, eq=False)
class Card:
    """What a result shows of itself.

    Attributes
    ----------
    title : str
        What it is, with the verdict.
    tables : tuple of Table
    notes : tuple of str
        Sentences below the tables.
    """

    title: str
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()


class Displayed(ABC):
    """Base of every result that shows itself; a dataclass needs ``repr=False``.

    Examples
    --------
    >>> class Answer(Displayed):
    ...     def _card(self):
    ...         return Card("Answer", (quantities(("value", 42), ("mass [kg]", 0.5)),))
    >>> Answer()
    Answer
      value       42
      mass [kg]  0.5
    """

    @abstractmethod
    def _card(self) -> Card:
        """Say what is worth showing."""

    def __repr__(self) -> str:
        return as_text(self._card())

    def _repr_html_(self) -> str:
        return as_html(self._card())


def quantities(*rows: tuple[str, Any], caption: str = "", digits: int = 6) -> Table:
    """Return a list of named quantities as a table without a head."""
    return Table(caption, (), rows, digits)


class FormattedNumber(float):
    """A number that brings its own text, and sorts and calculates as a number."""

    text: str

    def __new__(cls, value: float, text: str) -> FormattedNumber:
        """Join a number and its text."""
        self = super().__new__(cls, value)
        self.text = text
        return self


def estimate(value: float, error: float) -> tuple[float, float]:
    """Return a value and its standard error, whose texts end at the error's second digit.

    A value that is larger than its error by more than nine digits keeps ten.

    Examples
    --------
    >>> from robustpolish.base.results import estimate, shown
    >>> [shown(number) for number in estimate(0.0123456, 0.000234)]
    ['0.01235', '0.00023']
    >>> [shown(number) for number in estimate(4123456.0, 123456.0)]
    ['4.12e+06', '1.2e+05']
    """
    if not (math.isfinite(value) and 0 < error < math.inf):
        return value, error
    last = math.floor(math.log10(float(f"{error:.1e}"))) - 1
    first = max(last + 1, math.floor(math.log10(abs(value))) if value else last)
    if -4 <= first < 6 and -6 <= last <= 0:
        text, short = f"{value:.{-last}f}", f"{error:.{-last}f}"
    else:
        text, short = f"{value:.{min(first - last, 9)}e}", f"{error:.1e}"
    return FormattedNumber(value, text), FormattedNumber(error, short)


def plus_minus(value: float, error: float, digits: int = 5) -> str:
    """Return a value and its standard error in a line; the value alone where none is known.

    Examples
    --------
    >>> from robustpolish.base.results import plus_minus
    >>> plus_minus(9.0312, 0.0418), plus_minus(2.0, math.nan)
    ('9.031 +- 0.042', '2')
    """
    if math.isnan(error):
        return f"{value:.{digits}g}"
    return " +- ".join(shown(number, digits) for number in estimate(value, error))


def shown(value: Any, digits: int = 4, missing: str = "-") -> str:
    """Return a cell as text: rounded numbers, yes and no, a dash where there is nothing."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return missing
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, FormattedNumber):
        return value.text
    if isinstance(value, float | complex):
        return f"{value:.{digits}g}"
    if isinstance(value, Iterable) and not isinstance(value, str):
        return ", ".join(shown(item, digits, missing) for item in value)
    return str(value)


def as_text(card: Card) -> str:
    """Return a card as aligned text."""
    lines = []
    for table in card.tables:
        lines += [table.caption] * bool(table.caption) + _aligned(table)
    indent = "  " if card.title else ""
    titles = [card.title] if card.title else []
    return "\n".join([*titles, *(indent + line for line in (*lines, *card.notes))])


def as_html(card: Card) -> str:
    """Return a card as HTML without style: notebooks bring their own."""
    parts = [f"<strong>{html.escape(card.title)}</strong>"] if card.title else []
    parts += [_html_table(table) for table in card.tables]
    parts += [f"<p>{html.escape(note)}</p>" for note in card.notes]
    return f"<div>{''.join(parts)}</div>"


def _aligned(table: Table) -> list[str]:
    rows = [list(table.columns)] * bool(table.columns) + table.cells()
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    right = table.numeric() or [False] * len(widths)
    sides = [str.rjust if flush else str.ljust for flush in right]
    return [
        "  ".join(map(lambda side, *to: side(*to), sides, row, widths)).rstrip() for row in rows
    ]


def _html_table(table: Table) -> str:
    names = "".join(f"<th>{html.escape(name)}</th>" for name in table.columns)
    head = f"<thead><tr>{names}</tr></thead>" if table.columns else ""
    styles = [' style="text-align: right"' if flush else "" for flush in table.numeric()]
    rows = "".join(
        f"<tr>{''.join(map(lambda s, c: f'<td{s}>{html.escape(c)}</td>', styles, row))}</tr>"
        for row in table.cells("–")
    )
    caption = f"<caption>{html.escape(table.caption)}</caption>" if table.caption else ""
    return f"<table>{caption}{head}<tbody>{rows}</tbody></table>"


def _is_number(cell: Any) -> bool:
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


_PREFIXES = dict(zip(range(-30, 31, 3), (*"qryzafpnµm", "", *"kMGTPEZYRQ"), strict=True))
# SI units by their symbols alone: others, such as mm, kg or min, have a prefix or bear none. One
# before a power ("mm^2") would be read wrongly.
_PREFIXABLE = re.compile(
    r"(m|s|g|A|K|N|Nm|V|W|J|Pa|Hz|rad|C|F|H|S|T|Wb|Ω|ohm)(?![A-Za-zΩ_^²³0-9]|\*\*)"
)


def bears_prefix(unit: str) -> bool:
    """Say whether a prefix may stand before a unit; not before none, %, 1/s, m^2, kg and mm.

    Parameters
    ----------
    unit : str

    Returns
    -------
    bool
    """
    return _PREFIXABLE.match(unit) is not None


def prefix_power(size: float) -> int:
    """Return the power of ten of the prefix that suits a size, a multiple of 3.

    Parameters
    ----------
    size : float
        0 and what is not finite get none.

    Returns
    -------
    int
    """
    power = 3 * math.floor(math.log10(size) / 3) if 0 < size < math.inf else 0
    return min(max(power, min(_PREFIXES)), max(_PREFIXES))


def prefixed(unit: str, power: int) -> str:
    """Return a unit with the prefix of a power of ten.

    Parameters
    ----------
    unit : str
    power : int

    Returns
    -------
    str

    Examples
    --------
    >>> from robustpolish.base.results import prefix_power, prefixed
    >>> prefixed("m", prefix_power(2.1e-5))
    'µm'
    """
    return _PREFIXES[power] + unit
