"""Write docs/validation.md: the thesis's numbers, ours, and the reading that joins them.

Run with ``python docs/build_validation.py``; every figure in the page is computed here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

import robustpolish as rp
from robustpolish.analysis import modes
from robustpolish.synthesis.published_controllers import published_gain

PAGE = Path(__file__).with_name("validation.md")

Row = tuple[str, float, float, str]

INTRODUCTION = """\
# Validation

What M.L. Postma's thesis *Polishing robot: vibrations due to impact* prints, what robustpolish
computes, and what explains each gap. The page is written by `python docs/build_validation.py`
(`make docs`), so the middle columns are measured, not typed.

The thesis's text, its table 9.1 and its listings contradict each other. `AirBearingParameters`
offers three readings: `as_published()` reproduces the printed results and is the default,
`as_printed()` takes table 9.1 to the letter, `corrected()` has the physically right inertia.
"""


def machine() -> Iterable[Row]:
    """Section 8.5 and table 9.1."""
    p = rp.AirBearingParameters.as_published()
    found = {round(mode.frequency_hz): mode for mode in modes(rp.air_bearing(p).open_loop)}
    reading = "bearing 1.337 kg (table 9.1: 0.337), inertia of listing D.2, k_t from (8.18)"
    yield "upper mode in x and y [Hz]", 2069.6, found[2070].frequency_hz, reading
    yield "lower mode in x and y [Hz]", 194.0691, found[194].frequency_hz, reading
    reading = "k_A = 1e9 N/m, as section 9.4.1 prefers (table 9.1: 1e10)"
    yield "upper mode in z [Hz]", 4610.7, found[4611].frequency_hz, reading
    yield "lower mode in z [Hz]", 2824.6, found[2825].frequency_hz, reading
    c = p.damping(0.001)
    yield "c_A [N s/m]", 1.3159, c.c_A, "(8.23) with k_t and omega_A"
    yield "c_D [N s/m]", 0.0389, c.c_D, "(8.23) with k_x and omega_D"
    yield "c_R [N s/m]", 0.5581, c.c_R, "(8.23) with k_z and the free-free frequency (k_A = 0)"
    yield "damping ratio of x_m", 8.1742e-5, found[2070].damping_ratio, "n = 0.001"
    yield "damping ratio of x", 7.9374e-5, found[194].damping_ratio, "n = 0.001"
    yield "damping ratio of z_m", 1.9923e-5, found[4611].damping_ratio, "n = 0.001"
    yield (
        "damping ratio of z",
        5.7860e-13,
        found[2825].damping_ratio,
        "the printed exponent is a misprint for -5, so the argument for c_Z in section 8.5 falls",
    )
    printed = rp.AirBearingParameters.as_printed().natural_frequencies()["x"][0] / (2 * math.pi)
    yield "upper mode in x, table 9.1 to the letter [Hz]", 2069.6, printed, "0.337 kg instead"


def open_loop() -> Iterable[Row]:
    """Sections 10.4.1 and 10.5."""
    one_percent = rp.air_bearing(dissipation=0.01).open_loop
    reading = "n = 0.01, though the text says 0.1 %"
    yield "H-infinity norm", 0.0021182, rp.hinf_norm(one_percent).value, reading
    yield "H2 norm", 0.0029477, rp.h2_norm(one_percent).value, reading + "; (10.45) gives the norm"
    thousandth = rp.hinf_norm(rp.air_bearing(dissipation=0.001).open_loop).value
    yield "H-infinity norm with n = 0.001", math.nan, thousandth, "ten times larger"


def controllers() -> Iterable[Row]:
    """Sections 11.1.1 and 11.2.1: the controllers of appendix C."""
    printed = {
        "first": ("C.3", 3.4459e-6, "displacement"),
        "first_scaled": ("C.4", 5.0011e-6, "displacement"),
        "second": ("C.5", 6.5060e-5, "force"),
        "second_scaled": ("C.6", 5.3719e-5, "force"),
    }
    for name, (label, published, actuation) in printed.items():
        loop = rp.air_bearing(actuation=actuation).state_feedback_loop(published_gain(name))
        found = rp.hinf_norm(loop)
        yield (
            f"H-infinity norm with {label}",
            published,
            found.value,
            "n = 0.001; stable; the thesis prints the solver's bound, not the loop's norm"
            if found.stable
            else "unstable",
        )


def table(rows: Iterable[Row]) -> str:
    """Return a Markdown table with the relative gap."""
    lines = [
        "| quantity | thesis | robustpolish | gap | reading |",
        "|---|---:|---:|---:|---|",
    ]
    for quantity, published, ours, reading in rows:
        known = not np.isnan(published)
        gap = f"{100 * (ours / published - 1):+.2g} %" if known and ours / published < 100 else "–"
        shown = f"{published:.6g}" if known else "–"
        lines.append(f"| {quantity} | {shown} | {ours:.6g} | {gap} | {reading} |")
    return "\n".join(lines)


def main() -> None:
    """Write the page."""
    parts = [
        INTRODUCTION,
        "## The machine (chapter 8)\n",
        table(machine()),
        "\n## Without control (chapter 10)\n",
        table(open_loop()),
        "\n## The printed controllers (appendix C)\n",
        table(controllers()),
    ]
    PAGE.write_text("\n".join(parts) + "\n", encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
