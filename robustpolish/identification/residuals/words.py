"""A residual analysis in words and in plain numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from robustpolish.identification.residuals.figures import ResidualFigures

# A place where the error is this many times denser than on average is worth a sentence.
_DENSE = 2.0


def explain(analysis: ResidualFigures) -> str:
    """Say where the error is, the largest shares first."""
    lines = ["Where the error is:"]
    for name in analysis.channels["output"].values:
        share = float(analysis.channels.sel(output=name))
        lines.append(
            f"  {name}: {_percent(share)} of the error, NRMSE {analysis.nrmse[str(name)]:.3g}"
        )
    lines += [_time(analysis), _frequency(analysis), *_lines(analysis), *_places(analysis)]
    lines += _phase(analysis)
    if analysis.contact is not None:
        share = analysis.overall(analysis.contact)
        time = float(analysis.contact["samples"][0])
        lines.append(
            f"  contact: {_percent(share[0])} of the error in {_percent(time)} of the "
            "samples; the rest in free flight"
        )
    return "\n".join([*lines, "Tests (99 % bands, 1 % by chance):", *_tests(analysis)])


def _time(analysis: ResidualFigures) -> str:
    share = analysis.overall(analysis.windows)
    worst = int(np.argmax(share.values))
    begin, end = (float(share[key][worst]) for key in ("begin", "end"))
    return f"  time: most in {begin:.4g} to {end:.4g} s, {_percent(share[worst])} of the error"


def _frequency(analysis: ResidualFigures) -> str:
    share = analysis.overall(analysis.bands)
    worst = int(np.argmax(share.values))
    low, high = (float(share[key][worst]) for key in ("low", "high"))
    inside = [f for f in analysis.modes["frequency"].values if low <= f < high]
    marks = ", ".join(f"the mode at {f:.4g} Hz" for f in inside)
    note = f", which holds {marks}" if marks else ""
    return f"  frequency: most in {low:.4g} to {high:.4g} Hz, {_percent(share[worst])}{note}"


def _lines(analysis: ResidualFigures) -> list[str]:
    found = []
    for table, what in ((analysis.modes, "mode"), (analysis.harmonics, "spin harmonic")):
        share = analysis.overall(table)
        for frequency, value in zip(share["frequency"].values, share.values, strict=True):
            if value > 0.1:
                found.append(f"  near the {what} at {frequency:.4g} Hz: {_percent(value)}")
    return found


def _places(analysis: ResidualFigures) -> list[str]:
    found = []
    for name, place in analysis.places.items():
        for table, what in ((place.displacement, "displacement"), (place.velocity, "velocity")):
            share = analysis.overall(table)
            samples = table["samples"].values
            dense = share.values / np.maximum(samples, 1e-12)
            dense[share.values < 0.05] = 0.0
            worst = int(np.argmax(dense))
            if dense[worst] > _DENSE:
                unit = place.surface[what].attrs["units"]
                at = float(share[what][worst])
                found.append(
                    f"  {what} of {name} near {at:.3g} {unit}: {_percent(share[worst])} of "
                    f"the error in {_percent(samples[worst], 1)} of the samples"
                )
    return found


def _phase(analysis: ResidualFigures) -> list[str]:
    if analysis.phase is None:
        return []
    share = analysis.overall(analysis.phase)
    worst = int(np.argmax(share.values))
    if share.values[worst] < _DENSE / share.size:
        return ["  spin phase: evenly spread"]
    angle = np.degrees(float(share["phase"][worst]))
    return [f"  spin phase: most near {angle:.0f} deg, {_percent(share[worst])} of the error"]


def _tests(analysis: ResidualFigures) -> list[str]:
    lines = [
        f"  autocorrelation of {name}: {_percent(test.flagged_share, 1)} of the lags outside, "
        f"largest {test.largest:.2f}"
        for name, test in analysis.autocorrelation.items()
    ]
    for (source, name), test in analysis.cross_correlation.items():
        coherent = analysis.coherence[source, name]
        lines.append(
            f"  {source} with {name}: correlation outside at {_percent(test.flagged_share, 1)} of "
            f"the lags, coherence above chance at {_percent(coherent.flagged_share, 1)} of the "
            "frequencies"
        )
    return lines


def to_dict(analysis: ResidualFigures) -> dict[str, Any]:
    """Return the shares and the figures of the tests as plain numbers."""
    return {
        "channels": _table(analysis.channels),
        "windows": _table(analysis.windows),
        "bands": _table(analysis.bands),
        "modes": _table(analysis.modes),
        "harmonics": _table(analysis.harmonics),
        "phase": None if analysis.phase is None else _table(analysis.phase),
        "contact": None if analysis.contact is None else _table(analysis.contact),
        "places": {
            name: {"displacement": _table(place.displacement), "velocity": _table(place.velocity)}
            for name, place in analysis.places.items()
        },
        "autocorrelation": {
            name: {"flagged_share": test.flagged_share, "largest": test.largest}
            for name, test in analysis.autocorrelation.items()
        },
        "cross_correlation": [
            {
                "input": source,
                "output": name,
                "flagged_share": test.flagged_share,
                "largest": test.largest,
                "coherent_share": analysis.coherence[source, name].flagged_share,
            }
            for (source, name), test in analysis.cross_correlation.items()
        ],
    }


def _table(array: xr.DataArray) -> dict[str, Any]:
    coordinates = {str(name): value.values.tolist() for name, value in array.coords.items()}
    return {**coordinates, "share": array.values.tolist()}


def _percent(share: Any, digits: int = 0) -> str:
    return f"{100 * float(share):.{digits}f} %"
