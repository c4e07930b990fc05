"""The figures of a loop as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robustpolish.display import Table
from robustpolish.loops.effort import Effort
from robustpolish.loops.figures import LoopFigures

# More rows than this are shortened to the worst source of each control.
_MOST_ROWS = 12


def tables_of(found: LoopFigures) -> tuple[Table, ...]:
    """Return what is known of a loop as tables; none for an unstable one."""
    if not found.stable:
        return ()
    tables = [_margins(found), _at_once(found), _bandwidths(found)]
    tables += [
        _efforts("Noise on the measurements: what the controls do", found.noise),
        _efforts("Disturbances: what the controls do", found.effort),
    ]
    if found.given:
        rows = tuple(
            (row.control, row.peak, row.rms, row.peak_rate, row.unit) for row in found.given
        )
        head = ("control", "peak", "RMS", "rate [1/s]", "unit")
        tables.append(Table("Under the given disturbance", head, rows))
    if found.sample_rate is not None:
        rate = found.sample_rate
        rules: list[tuple[Any, ...]] = list(rate.rules.items())
        rules += [("needed", rate.needed_hz), ("lowest stable", rate.lowest_stable_hz)]
        tables.append(Table("Sampling", ("rule", "rate [Hz]"), tuple(rules)))
    return tuple(tables)


def _margins(found: LoopFigures) -> Table:
    head = (
        "broken at", "signal", "gain down [dB]", "gain up [dB]", "phase [deg]", "delay [s]",
        "disk", "disk [dB]", "disk [deg]", "modulus",
    )  # fmt: skip
    rows = tuple(
        (
            m.place, m.name, m.gain_down_db, m.gain_up_db, m.phase_deg, m.delay_s,
            m.disk.alpha, m.disk.gain_db, m.disk.phase_deg, m.modulus,
        )
        for m in found.margins
    )  # fmt: skip
    return Table("Margins, one loop at a time", head, rows)


def _at_once(found: LoopFigures) -> Table:
    head = (
        "changed at", "disk", "disk [dB]", "disk [deg]", "worst at [Hz]",
        "common delay [s]", "any delays [s]",
    )  # fmt: skip
    rows = tuple(
        (
            where, m.disk.alpha, m.disk.gain_db, m.disk.phase_deg, m.disk.frequency_hz,
            m.common_delay_s, m.any_delay_s,
        )
        for where, m in found.at_once.items()
    )  # fmt: skip
    return Table("Margins, all at once", head, rows)


def _bandwidths(found: LoopFigures) -> Table:
    head = (
        "broken at", "signal", "crossover [Hz]", "S -3 dB [Hz]", "T -3 dB [Hz]", "peak S", "peak T",
    )  # fmt: skip
    rows = tuple(
        (
            row.place, row.name, row.crossover_hz, row.sensitivity_hz, row.complementary_hz,
            row.peak_s, row.peak_t,
        )
        for row in found.bandwidths
    )  # fmt: skip
    return Table("Bandwidths", head, rows)


def _efforts(caption: str, rows: Sequence[Effort]) -> Table:
    head = (
        "source",
        "control",
        "RMS",
        "peak gain",
        "at [Hz]",
        "step peak",
        "step rate [1/s]",
        "unit",
    )
    kept = [row for row in rows if row.peak_gain > 0]
    if len(kept) > _MOST_ROWS:
        controls = dict.fromkeys(row.control for row in kept)
        kept = [
            max((row for row in kept if row.control == name), key=lambda row: row.peak_gain)
            for name in controls
        ]
        caption += ", the strongest source of each"
    cells = tuple(
        (
            row.source, row.control, row.rms, row.peak_gain, row.peak_gain_hz,
            row.step_peak, row.step_rate, _per(row),
        )
        for row in kept
    )  # fmt: skip
    return Table(caption, head, cells)


def _per(row: Effort) -> str:
    """Return the unit of the control for a unit of its source."""
    return f"{row.unit}/{row.source_unit}" if row.unit and row.source_unit else ""
