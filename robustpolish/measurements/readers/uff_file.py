"""Universal files of modal analysis, data set 58, through pyuff."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from robustpolish.errors import MissingDependencyError
from robustpolish.measurements.raw import RawTable, unreadable
from robustpolish.validation import described, invalid

_TIME_RESPONSE = 1


def read_uff(path: Path) -> RawTable:
    """Read the time responses of a universal file; spectra in it are left out with a note."""
    try:
        import pyuff
    except ImportError:
        raise MissingDependencyError(
            "Universal files need pyuff: pip install 'robustpolish[io]'."
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pyuff warns of every field that is blank
            file = pyuff.UFF(str(path))
            kinds = np.atleast_1d(file.get_set_types())
            sets: list[Any] = [file.read_sets(int(i)) for i in np.flatnonzero(kinds == 58)]
    except Exception as error:  # pyuff raises bare Exception
        raise unreadable(path, "universal (UFF)", error) from None
    responses = [item for item in sets if item.get("func_type") == _TIME_RESPONSE]
    if not responses:
        raise invalid(
            "measurement",
            described(f"{path} without time responses"),
            "data sets 58 with function type 1",
            "Export time records, not spectra.",
        )
    table = RawTable()
    if len(responses) < len(kinds):
        table.notes.append(
            f"left out: {len(kinds) - len(responses)} data sets without time records"
        )
    for item in responses:
        table.add(_name(item, table), np.real(item["data"]), _unit(item))
    first = np.asarray(responses[0]["x"], dtype=float)
    for item in responses[1:]:
        other = np.asarray(item["x"], dtype=float)
        if other.shape != first.shape or not np.allclose(
            other, first, atol=0.01 * np.ptp(first) / first.size
        ):
            shown = described(f"{path} with records over different times")
            raise invalid("measurement", shown, "one time axis", "Export them together.")
    table.columns = {"time": first, **table.columns}
    table.units["time"] = "s"
    return table


def _name(item: dict[str, Any], table: RawTable) -> str:
    label = str(item.get("id1") or "").strip()
    if not label or label.upper() == "NONE" or label in table.columns:
        directions = {1: "x", 2: "y", 3: "z", -1: "-x", -2: "-y", -3: "-z"}
        direction = directions.get(int(item.get("rsp_dir") or 0), "")
        label = f"node_{int(item.get('rsp_node') or 0)}{'_' + direction if direction else ''}"
    base, count = label, 1
    while label in table.columns:
        count += 1
        label = f"{base}_{count}"
    return label


def _unit(item: dict[str, Any]) -> str | None:
    unit = str(item.get("ordinate_axis_units_lab") or "").strip()
    return None if not unit or unit.upper() in ("NONE", "UNKNOWN") else unit
