"""One JSON file per result: written whole or not at all, read with suspicion."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AGREE
from robustpolish.base.atomic_writes import new_file
from robustpolish.base.checks import invalid, is_whole, misfit
from robustpolish.base.input_files import FileSpec, check_tree, text
from robustpolish.base.versions import __version__

FORMAT = 1
"""Raised when an older version of the package could not read the files any more."""


_SAVED = FileSpec("path", "a file", "Save one with .save(path).", 200_000_000)

_WORDS = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


def write_saved(
    path: str | os.PathLike[str], kind: str, content: Mapping[str, Any], force: bool = False
) -> None:
    """Write a result with the kind, the format's number and the package's version.

    Parameters
    ----------
    path : path
        Ends in ``.json``.
    kind : str
        "design", "diagnosis" or "plant".
    content : mapping
        Plain values, arrays and numbers; what is not finite becomes a word.
    force : bool, optional
        Replace an existing file.

    Raises
    ------
    InvalidInputError
        If the file exists and `force` is not set, or its folder does not exist.
    """
    head = {"robustpolish": kind, "format": FORMAT, "version": __version__}
    text = json.dumps({**head, **plain(content)}, indent=1, allow_nan=False)
    with new_file(path, force, (".json",)) as draft:
        draft.write_text(text + "\n", encoding="utf-8")


def read_saved(
    path: str | os.PathLike[str], kind: str | None = None, max_bytes: float | None = None
) -> Fields:
    """Read a file that :func:`write_saved` wrote.

    Parameters
    ----------
    path : path
    kind : str, optional
        The kind that it has to be; any by default.
    max_bytes : float, optional
        Largest size of the file in bytes, 2e8 by default.

    Returns
    -------
    Fields
        Its content; ``fields.kind`` tells what it is.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, is no file of this package, of another kind or of a newer
        format.
    """
    written = text(path, _SAVED.limited(max_bytes))
    name, remedy = Path(path).name, _SAVED.remedy
    try:
        content = json.loads(written, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise misfit("path", f"{name} ({error})", "a JSON file of robustpolish", remedy) from None
    check_tree(content, name)
    found = content.get("robustpolish") if isinstance(content, dict) else None
    if not isinstance(found, str):
        shown, want = f"{name}, which does not say what it holds", 'the key "robustpolish"'
        raise misfit("path", shown, f"a JSON file with {want}", remedy)
    if kind is not None and found != kind:
        raise misfit("path", f"a {found} in {name}", f"a {kind}", "Use rp.load(path).")
    fields = Fields(content, name)
    if fields.whole("format") > FORMAT:
        shown = f"format {content['format']} of robustpolish {content.get('version')}"
        raise misfit(name, shown, f"format {FORMAT} or older", "Update robustpolish.")
    return fields


class Fields:
    """The content of a file; every access checks, and complains with the name of the key.

    Parameters
    ----------
    content : dict
    where : str
        Name of the file and the key of the table in it.
    """

    def __init__(self, content: Mapping[str, Any], where: str) -> None:
        self._content, self.where = content, where

    @property
    def kind(self) -> str:
        """What the file holds."""
        return self.text("robustpolish")

    def __contains__(self, key: str) -> bool:
        return key in self._content

    def __iter__(self) -> Iterator[str]:
        return iter(self._content)

    def raw(self, key: str) -> Any:
        """Return what stands at a key, unchecked."""
        if key not in self._content:
            raise misfit(self.where, "a table without it", f"the key {key!r}", _EDITED)
        return self._content[key]

    def table(self, key: str) -> Fields:
        """Return the table at a key."""
        return self._as_table(key, self.raw(key))

    def tables(self, key: str) -> list[Fields]:
        """Return the list of tables at a key."""
        return [self._as_table(f"{key}[{i}]", item) for i, item in enumerate(self.items(key))]

    def items(self, key: str) -> list[Any]:
        """Return the list at a key."""
        return self._checked(key, lambda v: isinstance(v, list), "a list")

    def text(self, key: str, choices: tuple[str, ...] = ()) -> str:
        """Return the text at a key."""
        if choices:
            return self._checked(key, lambda v: v in choices, f"one of {', '.join(choices)}")
        return self._checked(key, lambda v: isinstance(v, str), "a text")

    def texts(self, key: str) -> tuple[str, ...]:
        """Return the list of texts at a key."""
        texts = self.items(key)
        right = all(isinstance(item, str) for item in texts)
        return tuple(self._checked(key, lambda _: right, "a list of texts"))

    def truth(self, key: str) -> bool:
        """Return the truth value at a key."""
        return self._checked(key, lambda v: isinstance(v, bool), "true or false")

    def number(self, key: str) -> float:
        """Return the number at a key; the words inf, -inf and nan count as such."""
        value = self.raw(key)
        if isinstance(value, str) and value in _WORDS:
            return _WORDS[value]
        is_number = is_whole(value) or isinstance(value, float)
        return float(self._checked(key, lambda _: is_number, "a number"))

    def numbers(self, key: str) -> dict[str, float]:
        """Return the table of numbers at a key."""
        table = self.table(key)
        return {name: table.number(name) for name in table}

    def whole(self, key: str) -> int:
        """Return the whole number at a key."""
        return self._checked(key, is_whole, "a whole number")

    def array(self, key: str, *shape: int | None) -> NDArray[np.float64]:
        """Return the array at a key; None in the shape leaves a length free."""
        value, want = self.raw(key), f"numbers of shape {shape}".replace("None", "any")
        try:
            array = np.array(_encode_nonfinite(value), dtype=float)
        except (TypeError, ValueError):
            raise invalid(f"{self.where}: {key}", value, want, _EDITED) from None
        if array.size == 0 and 0 in shape:  # a list of nothing does not tell how wide it is
            array = np.zeros([n or 0 for n in shape])
        if array.ndim != len(shape) or any(
            n not in (None, m) for n, m in zip(shape, array.shape, strict=True)
        ):
            raise misfit(f"{self.where}: {key}", f"shape {array.shape}", want, _EDITED)
        return array

    def _as_table(self, key: str, value: Any) -> Fields:
        if not isinstance(value, dict):
            raise invalid(f"{self.where}: {key}", value, "a table", _EDITED)
        return Fields(value, f"{self.where}: {key}")

    def _checked(self, key: str, right: Callable[[Any], bool], want: str) -> Any:
        """Return the value at a key if it is right, which the message calls `want`."""
        value = self.raw(key)
        if not right(value):
            raise invalid(f"{self.where}: {key}", value, want, _EDITED)
        return value


_EDITED = "The file is damaged or was edited; save it again."


def plain(value: Any, nan: str | None = "nan") -> Any:
    """Return a value as JSON can hold it: arrays as lists, what is not finite as a word."""
    if isinstance(value, Mapping):
        return {str(key): plain(item, nan) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, nan) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), nan)
    if isinstance(value, np.generic):
        return plain(value.item(), nan)
    if isinstance(value, float) and not math.isfinite(value):
        return nan if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return value


def _encode_nonfinite(value: Any) -> Any:
    if isinstance(value, list):
        return [_encode_nonfinite(item) for item in value]
    if isinstance(value, str):
        return _WORDS.get(value, value)
    if value is None or isinstance(value, bool):
        raise TypeError
    return value


def _no_constant(word: str) -> Any:
    raise ValueError(f"{word} is not JSON")


def confirm_norm(fields: Fields, certificate: Any, remedy: str) -> float:
    """Return the norm that a file states, if the certificate of its loop, made anew, bears it out.

    Parameters
    ----------
    fields : Fields
        With the key ``achieved``.
    certificate : Certificate or SampledCertificate
    remedy : str
        What to do with a file that was changed.

    Raises
    ------
    InvalidInputError
        If the controller earns no certificate, or its loop has another norm.
    """
    if not certificate.valid:
        shown = f"a controller without a valid certificate: {certificate.reasons[0]}"
        raise misfit(fields.where, shown, "a controller that keeps its promise", remedy)
    told = fields.number("achieved")
    # How far, relative, a norm computed anew may lie from the one in a file.
    if not math.isclose(told, certificate.achieved, rel_tol=AGREE):
        shown = f"a norm of {told:.6g} for a loop that has {certificate.achieved:.6g}"
        raise misfit(f"{fields.where}: achieved", shown, "the norm of the loop", remedy)
    return told
