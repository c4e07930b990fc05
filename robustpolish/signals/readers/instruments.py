"""Files of instruments: TDMS of LabVIEW through npTDMS, universal files (data set 58) by pyuff."""

from __future__ import annotations

import logging
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec, open_checked
from robustpolish.errors import MissingDependencyError
from robustpolish.signals.raw import RECORD, TIME_UNIT, RawResponse, RawTable, library_errors
from robustpolish.signals.readers.arrays import one_rate
from robustpolish.signals.time_axis import find_time

# LabVIEW's TDMS files, through npTDMS.


def read_tdms(path: Path, table: str | None = None, wanted: FileSpec = RECORD) -> RawTable:
    """Read the channels of a TDMS file, or of one group of it.

    The waveform properties give sampling rate and unit.
    """
    nptdms = _optional("nptdms", "TDMS files need npTDMS")
    # npTDMS writes whole damaged files to the log
    import_module("nptdms.log").log_manager.set_level(logging.CRITICAL)
    # npTDMS raises ValueError, struct.error and KeyError on damage
    with open_checked(path, wanted) as stream, library_errors(path, "TDMS"):
        file = nptdms.TdmsFile.open(stream)
        size = 8 * sum(len(c) for group in file.groups() for c in group.channels())
        if size > wanted.largest:
            raise wanted.too_large(path, size, packed=True)
        groups = {
            group.name: [(c.name, np.asarray(c[:]), dict(c.properties)) for c in group.channels()]
            for group in file.groups()
        }
        cut = file.file_status.incomplete_final_segment
    filled = {name: channels for name, channels in groups.items() if channels}
    if table is not None and table not in filled:
        raise invalid("table", table, f"a group: {', '.join(filled)}", "Check its name.")
    chosen = {table: filled[table]} if table is not None else filled
    result, rates = RawTable(), {}
    clocks: dict[str, Any] = {}
    starts: dict[str, float] = {}
    for group, channels in chosen.items():
        for name, values, properties in channels:
            units = filter(None, map(properties.get, _UNIT_PROPERTIES))
            label = name if len(chosen) == 1 else f"{group}/{name}"
            result.add(label, values, next(map(str, units), None))
            if properties.get("wf_increment"):
                rates[label] = 1 / float(properties["wf_increment"])
                starts[label] = float(properties.get("wf_start_offset", 0.0))
                clocks[label] = properties.get("wf_start_time")
    if cut:
        result.notes.append("cut off: the last segment is shorter than its head says")
    result.sampling_rate = one_rate(path, rates)
    first = min((clock for clock in clocks.values() if clock is not None), default=None)
    for label, clock in clocks.items():
        if clock is not None and first is not None:
            starts[label] += float((clock - first) / np.timedelta64(1, "ns")) * 1e-9
    if result.sampling_rate and find_time(result, None) is None:
        result.start_together(starts, 1 / result.sampling_rate)
    return result


_UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "units", "unit")


_TIME_RESPONSE, _FREQUENCY_RESPONSE, _COHERENCE = 1, 4, 6
_DIRECTIONS = {1: "x", 2: "y", 3: "z", -1: "-x", -2: "-y", -3: "-z"}


def read_uff(path: Path, wanted: FileSpec = RECORD) -> RawTable:
    """Read the time responses of a universal file; spectra in it are left out with a note."""
    sets, count = _sets(path, wanted)
    responses = [item for item in sets if item.get("func_type") == _TIME_RESPONSE]
    if not responses:
        want = "data sets 58 with function type 1"
        remedy = "Export time records, or read it with read_frequency_response."
        raise misfit("measurement", f"{path} without time responses", want, remedy)
    table = RawTable()
    if len(responses) < count:
        table.notes.append(f"left out: {count - len(responses)} data sets without time records")
    first = np.asarray(responses[0]["x"], dtype=float)
    for item in responses:
        table.add(_name(item, table), np.real(item["data"]), _uff_unit(item))
    apart = 0.01 * np.ptp(first) / first.size
    for other in (np.asarray(item["x"], dtype=float) for item in responses):
        if other.shape != first.shape or not np.allclose(other, first, atol=apart):
            shown = f"{path} with records over different times"
            raise misfit("measurement", shown, "one time axis", "Export them together.")
    table.columns = {"time": first, **table.columns}
    unit = _uff_unit(responses[0], "abscissa")
    table.units["time"] = unit if TIME_UNIT.fullmatch(unit) else "s"
    return table


def read_uff_responses(path: Path, wanted: FileSpec = RECORD) -> list[RawResponse]:
    """Read the frequency responses of a universal file, and their coherences."""
    found = []
    for item in _sets(path, wanted)[0]:
        ends = _end(item, "rsp"), _end(item, "ref"), np.asarray(item["x"], dtype=float)
        values, axis = np.asarray(item["data"]), _uff_unit(item, "abscissa") or "Hz"
        if item.get("func_type") == _FREQUENCY_RESPONSE:
            found.append(RawResponse(*ends, values, _ratio(item), frequency_unit=axis))
        elif item.get("func_type") == _COHERENCE:
            curve = np.real(values)
            found.append(RawResponse(*ends, curve, kind="coherence", frequency_unit=axis))
    return found


def uff_holds_responses_only(path: Path) -> bool:
    """Return whether a universal file has frequency responses and no time records."""
    kinds = {item.get("func_type") for item in _sets(path, RECORD)[0]}
    return _FREQUENCY_RESPONSE in kinds and _TIME_RESPONSE not in kinds


def _sets(path: Path, wanted: FileSpec) -> tuple[list[Any], int]:
    """Return the data sets 58 of a file, and how many data sets it has in all."""
    pyuff = _optional("pyuff", "Universal files need pyuff")
    with open_checked(path, wanted):  # pyuff opens it by its name once more
        pass
    with library_errors(path, "universal (UFF)"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyuff warns of every field that is blank
        file = pyuff.UFF(str(path))
        kinds = np.atleast_1d(file.get_set_types())
        sets: list[Any] = [file.read_sets(int(i)) for i in np.flatnonzero(kinds == 58)]
        for item in sets:
            if np.shape(item["x"]) != np.shape(item["data"]):
                raise ValueError("a record that is shorter than its axis")
            told, there = int(item.get("num_pts") or 0), len(item["x"])
            if told > there:
                raise ValueError(f"{told} points announced, {there} there: it was cut off")
            # Rows are filled up with numbers that are no points.
            item["x"], item["data"] = item["x"][: told or there], item["data"][: told or there]
    return sets, len(kinds)


def _optional(module: str, needed: str) -> Any:
    """Import a package of the extra [io]."""
    try:
        return import_module(module)
    except ImportError:
        raise MissingDependencyError(f"{needed}: pip install 'robustpolish[io]'.") from None


def _end(item: dict[str, Any], which: str) -> str:
    """Return the name of the response or the reference of a data set."""
    return _label(item, f"{which}_ent_name") or _node(item, which)


def _label(item: dict[str, Any], key: str, nothing: tuple[str, ...] = ("NONE",)) -> str:
    label = str(item.get(key) or "").strip()
    return "" if label.upper() in nothing else label


def _node(item: dict[str, Any], which: str) -> str:
    direction = _DIRECTIONS.get(int(item.get(f"{which}_dir") or 0), "")
    return f"node_{int(item.get(f'{which}_node') or 0)}{'_' + direction if direction else ''}"


def _ratio(item: dict[str, Any]) -> str:
    """Return the unit of a frequency response; empty if one of its ends has none."""
    above, below = _uff_unit(item), _uff_unit(item, "orddenom")
    if above and not below and "/" in above and any(c in above for c in "NF"):
        return above  # the whole ratio stands above, as some instruments write it
    return f"({above})/({below})" if above and below else ""


def _name(item: dict[str, Any], table: RawTable) -> str:
    base = _label(item, "id1")
    if not base or base in table.columns:
        base = _node(item, "rsp")
    label, count = base, 1
    while label in table.columns:
        count += 1
        label = f"{base}_{count}"
    return label


def _uff_unit(item: dict[str, Any], axis: str = "ordinate") -> str:
    return _label(item, f"{axis}_axis_units_lab", ("NONE", "UNKNOWN"))
