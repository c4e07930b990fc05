"""LabVIEW's TDMS files, through npTDMS."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np

from robustpolish.errors import InvalidInputError, MissingDependencyError
from robustpolish.files import Wanted, opened
from robustpolish.measurements.raw import RECORD, RawTable, unreadable
from robustpolish.validation import described, invalid


def read_tdms(path: Path, table: str | None = None, wanted: Wanted = RECORD) -> RawTable:
    """Read the channels of a TDMS file, or of one group of it.

    The waveform properties give sampling rate and unit.
    """
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError:
        raise MissingDependencyError(
            "TDMS files need npTDMS: pip install 'robustpolish[io]'."
        ) from None
    log_manager.set_level(logging.CRITICAL)  # npTDMS writes whole damaged files to the log
    with opened(path, wanted) as stream:
        try:
            file = TdmsFile.open(stream)
            size = 8 * sum(len(c) for group in file.groups() for c in group.channels())
            if size > wanted.largest:
                raise wanted.too_large(path, size, packed=True)
            groups = {
                group.name: [
                    (c.name, np.asarray(c[:]), dict(c.properties)) for c in group.channels()
                ]
                for group in file.groups()
            }
        except InvalidInputError:
            raise
        except Exception as error:  # npTDMS raises ValueError, struct.error, KeyError on damage
            raise unreadable(path, "TDMS", error) from None
    filled = {name: channels for name, channels in groups.items() if channels}
    if table is not None and table not in filled:
        raise invalid("table", table, f"a group: {', '.join(filled)}", "Check its name.")
    chosen = {table: filled[table]} if table is not None else filled
    result = RawTable()
    steps = set()
    for group, channels in chosen.items():
        for name, values, properties in channels:
            label = name if len(chosen) == 1 else f"{group}/{name}"
            result.add(label, values, _unit(properties))
            if properties.get("wf_increment"):
                steps.add(float(properties["wf_increment"]))
    if len(steps) > 1:
        raise invalid(
            "measurement",
            described(f"{path} with sampling times {sorted(steps)} s"),
            "one sampling time",
            "Pass table=GROUP for the channels that belong together.",
        )
    if steps:
        result.sampling_rate = 1 / steps.pop()
    return result


def _unit(properties: dict[str, Any]) -> str | None:
    for key in ("unit_string", "NI_UnitDescription", "units", "unit"):
        if properties.get(key):
            return str(properties[key])
    return None
