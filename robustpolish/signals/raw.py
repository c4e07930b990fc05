"""What a reader gets out of a file, before any check."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec
from robustpolish.errors import InvalidInputError
from robustpolish.signals.headers import split_header

RECORD = FileSpec("measurement", "a file", "Check the path.", 1_000_000_000)
"""What a file with a record is, unpacked no larger than a gigabyte."""


_SAME_SAMPLE = 0.05  # of a step, what stamps of clocks are rounded to


@dataclass
class RawTable:
    """Columns of a file with their units as written.

    Attributes
    ----------
    columns : dict of str to array
        Values by name, of any length.
    units : dict of str to str
        Unit by name where the file gives one.
    sampling_rate : float or None
        In Hz, where the file gives one.
    start : float
        Time of the first sample in s, for files without a column of times.
    notes : list of str
        What was done or left out on the way.
    lines : ndarray of int or None
        Line of the file by sample, where there are lines.
    headers : dict of str to str
        Name by header as it stands in the file.
    """

    columns: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    sampling_rate: float | None = None
    start: float = 0.0
    notes: list[str] = field(default_factory=list)
    lines: np.ndarray | None = None
    headers: dict[str, str] = field(default_factory=dict)

    def add(
        self, header: str, values: Any, unit: str | None = None, fraction: bool = False
    ) -> None:
        """Add a column; its header may hold the unit, as in ``x [mm]`` or, if `fraction`, x/mm."""
        name, written = split_header(header, fraction)
        if name in self.columns:
            raise invalid("column", name, "a name used once", "Rename one of the columns.")
        self.columns[name] = values
        self.headers[str(header).strip()] = name
        if unit or written:
            self.units[name] = unit or written

    def start_together(self, starts: Mapping[str, float], step: float) -> None:
        """Cut columns that start at different times, in s, to what all of them cover.

        Raises
        ------
        InvalidInputError
            If they do not start a whole number of steps apart.
        """
        self.start = max(starts.values())
        for name, start in starts.items():
            late = (self.start - start) / step
            if abs(late - round(late)) > _SAME_SAMPLE or round(late) >= np.size(self.columns[name]):
                shown = f"{name}, which starts {self.start - start:.6g} s before another channel"
                want = f"one start, or starts whole steps of {step:.6g} s apart within the record"
                raise misfit("measurement", shown, want, "Resample, or pass table= or columns=.")
            self.columns[name] = self.columns[name][round(late) :]
        if spread := self.start - min(starts.values()):
            length = min(np.size(self.columns[name]) for name in starts)
            self.columns |= {name: self.columns[name][:length] for name in starts}
            self.notes.append(f"channels start up to {spread:.6g} s apart: cut to what all cover")

    def resolve(self, argument: str, name: str) -> str:
        """Return the column that is meant: by name, by header, or by the end of a path in groups.

        Raises
        ------
        InvalidInputError
            If there is none, or several groups have one.
        """
        if name in self.columns:
            return name
        if self.headers.get(name) in self.columns:
            return self.headers[name]
        ends = [column for column in self.columns if column.endswith(f"/{name}")]
        if len(ends) == 1:
            return ends[0]
        shown = f"no channel {name!r}" if not ends else f"{name!r} in several groups"
        expected = f"the channels that are there: {', '.join(ends or self.columns) or 'none'}"
        raise misfit(argument, shown, expected, "Check the header, or rename with rename=.")

    def holds(self, name: str) -> bool:
        """Return whether one column or several may be meant by a name."""
        meant = {name, self.headers.get(name)}
        return any(c in meant or c.endswith(f"/{name}") for c in self.columns)

    def rename(self, names: Mapping[str, str]) -> None:
        """Call columns otherwise.

        Raises
        ------
        InvalidInputError
            If a column is not there, or two would have one name.
        """
        found: dict[str, str] = {}
        for old, new in names.items():
            if not isinstance(new, str) or not new:
                raise invalid(f"rename[{old!r}]", new, "a name", "Quote it.")
            found[self.resolve("rename", old)] = new
            self.headers[old] = new
        renamed = [found.get(name, name) for name in self.columns]
        for name in renamed:
            if renamed.count(name) > 1:
                expected = f"a name that no other column has: {self.listed()}"
                raise invalid("rename", name, expected, "Rename that column too.")
        self.columns = dict(zip(renamed, self.columns.values(), strict=True))
        self.units = {found.get(name, name): unit for name, unit in self.units.items()}

    def listed(self) -> str:
        """Say what there is, each column with its number of samples."""
        return ", ".join(f"{name} ({np.size(values)})" for name, values in self.columns.items())

    def place(self, sample: int) -> str:
        """Say where a sample is: in which line, if there are any."""
        return f"sample {sample}" if self.lines is None else f"line {self.lines[sample]}"


@contextmanager
def library_errors(source: object, kind: str) -> Iterator[None]:
    """Turn whatever a file's library raises on damage into an error of the package."""
    try:
        yield
    except InvalidInputError:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        shown, remedy = f"{source} ({reason})", "Check that the file is whole and its suffix right."
        raise misfit("measurement", shown, f"a readable {kind} file", remedy) from None


# What a reader gets out of a file of frequency responses, before any check.


@dataclass(frozen=True, eq=False)
class RawResponse:
    """One curve over frequency, as written.

    Attributes
    ----------
    output, input : str
        What was measured, and what drove the machine.
    frequency : ndarray, shape (lines,)
        In `frequency_unit`.
    values : ndarray, shape (lines,)
        Complex for a response, real for its coherence or variance.
    unit : str
        Of the response; empty if the file gives none.
    kind : {"response", "coherence", "variance"}
    frequency_unit : str
    """

    output: str
    input: str
    frequency: np.ndarray
    values: np.ndarray
    unit: str = ""
    kind: Literal["response", "coherence", "variance"] = "response"
    frequency_unit: str = "Hz"
