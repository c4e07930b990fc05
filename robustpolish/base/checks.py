"""Checks of arguments, and the one form in which they complain."""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any, TypeGuard, TypeVar

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.errors import InvalidInputError

T = TypeVar("T", bound=Hashable)
C = TypeVar("C")
Key = tuple[str | int, ...]


def invalid(
    argument: str | Key, value: object, expected: str, remedy: str, key: Key | None = None
) -> InvalidInputError:
    """Build the error for a bad argument; the caller raises it.

    Parameters
    ----------
    argument : str or tuple of str or int
        Name of the argument, or where it stands from the outside in:
        ``("spring", 1, "stiffness")`` is shown as ``spring[1].stiffness``.
    value : object
        What came; shown shortened.
    expected : str
        What the argument has to be.
    remedy : str
        What to do next, as an imperative sentence.
    key : tuple of str or int, optional
        Where the argument stands, if its name does not say it.

    Returns
    -------
    InvalidInputError

    Examples
    --------
    >>> error = invalid(("spring", 1, "stiffness"), "3", "a number", "Write a number.")
    >>> print(error)
    spring[1].stiffness: got '3', expected a number. Write a number.
    >>> error.key
    ('spring', 1, 'stiffness')
    """
    path = argument if isinstance(argument, tuple) else (argument,)
    shown = value if isinstance(value, _Described) else repr(value)
    text = str(shown)
    if len(text) > 120:
        text = text[:117] + "..."
    message = f"{_path_text(path)}: got {text}, expected {expected}. {remedy}"
    return InvalidInputError(message, path if key is None else key)


def _path_text(path: Key) -> str:
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(parts).removeprefix(".")


class _Described(str):
    """A description that :func:`invalid` prints without quotation marks."""


def described(text: str) -> str:
    """Mark `text` as a description of a value, to be printed as it is."""
    return _Described(text)


def misfit(
    argument: str | Key, found: str, expected: str, remedy: str, key: Key | None = None
) -> InvalidInputError:
    """Build the error for a bad argument that is described by `found`; see :func:`invalid`."""
    return invalid(argument, _Described(found), expected, remedy, key)


@contextmanager
def inside(where: Key) -> Iterator[None]:
    """Say of what is complained about inside where it stands.

    Examples
    --------
    >>> with inside(("actuators", "F")):
    ...     raise invalid("order", 0, "a whole number above 0", "Take 1.")
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: actuators.F.order: got 0, expected a whole number...
    """
    try:
        yield
    except InvalidInputError as error:
        message = f"{_path_text(where)}.{error}"
        raise InvalidInputError(message, (*where, *error.key)) from None


def closest_name_remedy(name: object, known: Iterable[str]) -> str:
    """Return the remedy for a name that is not known: the nearest one that is.

    Examples
    --------
    >>> closest_name_remedy(
    ...     "crossover", ["low", "crossover_hz"]), closest_name_remedy("quite else", ["low"]
    ... )
    ('Write crossover_hz.', 'Check its spelling.')
    """
    near = get_close_matches(str(name), list(known), 1)
    return f"Write {near[0]}." if near else "Check its spelling."


def known_keys(
    where: Key, table: Mapping[str, Any], known: Iterable[str], required: Iterable[str] = ()
) -> None:
    """Refuse keys of a table of a file that nobody reads, and the lack of those that are needed.

    Parameters
    ----------
    where : tuple of str or int
        Where the table stands.
    table : mapping
    known, required : iterable of str

    Raises
    ------
    InvalidInputError
        With the name of the key, and the nearest right one.
    """
    known = tuple(known)
    for key in table:
        if key not in known:
            listed, remedy = f"one of {', '.join(known)}", closest_name_remedy(key, known)
            raise misfit((*where, key), "an unknown key", listed, remedy)
    for key in required:
        if key not in table:
            what = f"no {key}" if where else f"no table {key}"
            raise misfit(where or (key,), what, f"{key} to be given", f"Add {key}.")


def source_of(system: control.StateSpace | None) -> control.StateSpace:
    """Return the system behind a result, which a result made by hand may lack."""
    if system is None:
        remedy = "Draw a result that a function of the package returned."
        raise invalid("system", system, "the system that the result belongs to", remedy)
    return system


def is_whole(value: object) -> TypeGuard[int]:
    """Return whether it is a whole number, Python's or NumPy's; True and False are none.

    Examples
    --------
    >>> is_whole(3), is_whole(np.int64(3)), is_whole(3.0), is_whole(True)
    (True, True, False, False)
    """
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def matrix(
    argument: str, value: ArrayLike, shape: tuple[int | None, int | None] = (None, None)
) -> NDArray[np.float64]:
    """Return `value` as a finite real matrix of the given shape.

    Parameters
    ----------
    argument : str
        Name of the argument, for the message.
    value : array_like
        Two-dimensional, real, finite. A scalar stands for a 1 x 1 matrix.
    shape : tuple
        Required rows and columns; None leaves one free.

    Returns
    -------
    ndarray of float, shape (rows, columns)

    Raises
    ------
    InvalidInputError
        If it is not numeric, complex, not two-dimensional, of another shape, or not finite.
    """
    sizes = ", ".join("any" if n is None else str(n) for n in shape)
    want = "a real matrix" + ("" if shape == (None, None) else f" of shape ({sizes})")
    try:
        given: Any = np.asarray(value)  # rows of different lengths end here
        array = (given.real if given.dtype.kind == "c" else given).astype(float)
    except (TypeError, ValueError):
        raise invalid(argument, value, want, "Pass nested lists or a NumPy array.") from None
    if np.iscomplexobj(given):
        raise misfit(argument, "complex entries", want, "Pass real numbers.")
    if array.ndim == 0:
        array = array.reshape(1, 1)
    if array.ndim != 2 or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
        raise misfit(argument, f"shape {array.shape}", want, "Check its rows and columns.")
    if not np.isfinite(array).all():
        row, column = np.argwhere(~np.isfinite(array))[0]
        found = f"{array[row, column]} at row {row}, column {column}"
        raise misfit(argument, found, "finite numbers", "Remove or replace the entry.")
    return array


def square(argument: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as a finite real matrix with as many rows as columns."""
    rows = matrix(argument, value).shape[0]
    return matrix(argument, value, (rows, rows))


def positive(argument: str | Key, value: Any, unit: str = "", zero: bool = False) -> float:
    """Return `value` as a finite float above zero (at least zero if `zero`)."""
    want = f"a finite number {'of at least' if zero else 'above'} 0{' ' + unit if unit else ''}"
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise invalid(argument, value, want, "Pass a number.") from None
    if not np.isfinite(number) or number < 0 or (number == 0 and not zero):
        raise invalid(argument, value, want, "Check its sign and unit.")
    return number


def whole_number(
    argument: str | Key, value: Any, least: int, most: int | None = None, remedy: str = ""
) -> int:
    """Return `value` as an int if it is a whole number from `least` to `most`."""
    if not is_whole(value) or value < least or (most is not None and value > most):
        bounds = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise invalid(argument, value, f"a whole number {bounds}", remedy)
    return int(value)


def one_of(
    argument: str | Key, value: T, choices: Collection[T], remedy: str = "Choose one of these."
) -> T:
    """Return `value` if it is one of `choices`."""
    if value not in choices:
        listed = ", ".join(repr(choice) for choice in choices)
        raise invalid(argument, value, f"one of {listed}", remedy)
    return value


def instance_of(
    argument: str | Key, value: Any, kind: type[C] | tuple[type[C], ...], expected: str, remedy: str
) -> C:
    """Return `value` if it is an instance of `kind`, which the message calls `expected`."""
    if not isinstance(value, kind):
        raise invalid(argument, described(type(value).__name__), expected, remedy)
    return value


def state_space(argument: str, value: Any) -> control.StateSpace:
    """Return `value` if it is a state-space system with finite matrices.

    Transfer functions and other systems are refused rather than realised
    silently, because a realisation has states without a meaning.
    """
    remedy = "Convert it with control.ss(...)."
    instance_of(argument, value, control.StateSpace, "a control.StateSpace", remedy)
    for name in "ABCD":
        M = getattr(value, name)
        # a sum of squares is finite more quickly than all entries are, but not where it overflows
        if M.dtype != float or not (math.isfinite(np.vdot(M, M)) or np.isfinite(M).all()):
            matrix(f"{argument}.{name}", M)  # says what is wrong
    return value
