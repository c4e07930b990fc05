"""Frequency responses in tables: what the head of each column says."""

from __future__ import annotations

import re

import numpy as np

from robustpolish.measurements.headers import split_header
from robustpolish.measurements.quality import numeric
from robustpolish.measurements.raw import RawTable
from robustpolish.measurements.raw_response import RawResponse
from robustpolish.measurements.units import to_si
from robustpolish.validation import described, invalid

FREQUENCY_NAMES = ("frequency", "freq", "hz", "frequenz")
ANGULAR_NAMES = ("omega", "angular frequency", "angular_frequency")
_LETTER = "f"  # in lower case only: F is a force
_PARTS = {
    "real": ("real", "re"),
    "imag": ("imaginary", "imag", "im"),
    "magnitude": ("magnitude", "amplitude", "mag", "abs", "gain"),
    "phase": ("phase", "angle", "arg"),
    "coherence": ("coherence", "coh"),
    "variance": ("variance", "var"),
}
_PART = {word: part for part, words in _PARTS.items() for word in words}
_WORDS = "|".join(sorted(_PART, key=len, reverse=True))
_BEHIND = re.compile(rf"^(?:(?P<pair>.*?)[\s_:]+)?(?P<part>{_WORDS})$", re.IGNORECASE)
_BEFORE = re.compile(rf"^(?P<part>{_WORDS})(?:[\s_:]+|\s*\()(?P<pair>.*?)\)?$", re.IGNORECASE)


def is_frequency(name: str) -> bool:
    """Return whether a column of this name, unit taken off, holds frequencies.

    Examples
    --------
    >>> is_frequency("Freq"), is_frequency("f"), is_frequency("F")
    (True, True, False)
    """
    text = name.strip()
    return text == _LETTER or text.casefold() in (*FREQUENCY_NAMES, *ANGULAR_NAMES)


def responses_of(table: RawTable) -> list[RawResponse]:
    """Sort the columns of a table into responses, coherences and variances.

    Parameters
    ----------
    table : RawTable
        One column of frequencies; of each pair the real and imaginary part, or magnitude and
        phase (in degrees unless the head says rad), or one complex column.

    Returns
    -------
    list of RawResponse

    Raises
    ------
    InvalidInputError
        If a column's head is not understood, or a part of a pair is missing.
    """
    table = _with_pairs(table)
    axis = next((name for name in table.columns if is_frequency(name)), None)
    if axis is None:
        listed = ", ".join(table.columns) or "none"
        raise invalid(
            "frequency",
            described(f"no such column among {listed}"),
            "a column 'frequency [Hz]'",
            "Name it so.",
        )
    unit = table.units.get(axis, "") or ("rad/s" if axis.casefold() in ANGULAR_NAMES else "Hz")
    frequency = numeric(axis, table.columns[axis])
    pairs: dict[str, dict[str, str]] = {}
    for name in table.columns:
        if name != axis:
            pair, part = _meaning(name, np.asarray(table.columns[name]).dtype.kind == "c")
            pairs.setdefault(pair, {})[part] = name
    found = []
    for pair, parts in pairs.items():
        output, _, source = (end.strip() for end in pair.partition("/"))
        ends = (output or "output", source or "input", frequency)
        values, of = _joined(pair, parts, table)
        found.append(RawResponse(*ends, values, of, frequency_unit=unit))
        for kind in ("coherence", "variance"):
            if kind in parts:
                curve = numeric(parts[kind], table.columns[parts[kind]])
                found.append(RawResponse(*ends, curve, kind=kind, frequency_unit=unit))
    return found


def _with_pairs(table: RawTable) -> RawTable:
    """Return the table with strokes as those of pairs: x/V is a response, not x in volts."""
    heads = {name: header for header, name in table.headers.items()}
    whole = RawTable()
    for name, values in table.columns.items():
        head, unit = heads.get(name, name), table.units.get(name)
        pair, _ = split_header(head)
        if pair != name and not is_frequency(name) and name.casefold() not in _PART:
            # a line of units may have said more than the stroke
            unit = None if unit == split_header(head, fraction=True)[1] else unit
            whole.add(head, values, unit)
        else:
            whole.add(name, values, unit)
    return whole


def _meaning(name: str, is_complex: bool) -> tuple[str, str]:
    """Return the pair that a column belongs to, and what part of it the column is."""
    text = name.strip()
    if is_complex:
        return text, "complex"
    bars = re.match(r"^\|(?P<pair>.+)\|$", text)
    if bars:
        return bars["pair"].strip(), "magnitude"
    found = _BEHIND.match(text) or _BEFORE.match(text)
    if not found:
        raise invalid(
            "column",
            name,
            "a head such as 'x/F real [m/N]', 'x/F imag [m/N]', 'x/F magnitude [m/N]', "
            "'x/F phase [deg]' or 'x/F coherence'",
            "Rename the column.",
        )
    return (found["pair"] or "").strip(), _PART[found["part"].casefold()]


def _joined(pair: str, parts: dict[str, str], table: RawTable) -> tuple[np.ndarray, str]:
    """Return the complex values of a pair, and their unit."""
    units = {part: table.units.get(name, "") for part, name in parts.items()}
    if "complex" in parts:
        return np.asarray(table.columns[parts["complex"]], dtype=complex), units["complex"]
    columns = {part: numeric(name, table.columns[name]) for part, name in parts.items()}
    if {"real", "imag"} <= set(parts):
        imag = columns["imag"]
        if units["imag"] and units["imag"] != units["real"]:
            scale = to_si(np.ones(1), units["imag"])[0] / to_si(np.ones(1), units["real"])[0]
            imag = imag * scale
        return columns["real"] + 1j * imag, units["real"]
    if {"magnitude", "phase"} <= set(parts):
        size, unit = columns["magnitude"], units["magnitude"]
        decibels = re.match(r"^dB(?:\s+re)?\s*(?:1\s)?\s*(.*)$", unit)
        if decibels:
            size, unit = 10 ** (size / 20), decibels[1].strip("() ")
        angle, _ = to_si(columns["phase"], units["phase"] or "deg", f"unit of {parts['phase']!r}")
        return size * np.exp(1j * angle), unit
    raise invalid(
        pair or "frequency response",
        described(f"the columns {', '.join(parts.values())}"),
        "real and imaginary part, or magnitude and phase",
        "Export the missing one: a magnitude alone does not say enough.",
    )
