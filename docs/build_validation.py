"""Write docs/validation.md: the thesis's numbers, ours, and the reading that joins them.

Run with ``python docs/build_validation.py``; every figure in the page is computed here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

import jinja2
import numpy as np
import validation_contact
import validation_moulds
import validation_rotors

import robustpolish as rp
from robustpolish.linear.modes import modes
from robustpolish.polishing.thesis.comparison import (
    PUBLISHED_CONTROLLERS,
    PUBLISHED_DEVIATIONS,
    PUBLISHED_NORMS,
    published_gain,
    thesis_comparison,
    thesis_structures,
)

PAGE = Path(__file__).with_name("validation.md")

Row = tuple[str, float, float, str]


def machine() -> Iterable[Row]:
    """Section 8.5 and table 9.1."""
    p = rp.polishing.AirBearingParameters.as_published()
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
    printed = rp.polishing.AirBearingParameters.as_printed().natural_frequencies()["x"][0] / (
        2 * math.pi
    )
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
    for name, published in PUBLISHED_NORMS.items():
        actuation = "displacement" if name.startswith("first") else "force"
        loop = rp.air_bearing(actuation=actuation).state_feedback_loop(published_gain(name))
        found = rp.hinf_norm(loop)
        yield (
            f"H-infinity norm with {PUBLISHED_CONTROLLERS[name]}",
            published,
            found.value,
            "n = 0.001; stable; the thesis prints the solver's bound, not the loop's norm"
            if found.stable
            else "unstable",
        )


def chapter_11(run: int) -> str:
    """Tables 11.1 to 11.8, recomputed with the listings as printed."""
    found = thesis_comparison(run).table["deviation"]
    signals = ("x", "y", "z")
    lines = [
        "| controller |" + "".join(f" {s} thesis | {s} ours | gap |" for s in signals),
        "|---|" + "---:|" * 9,
    ]
    for row, printed in PUBLISHED_DEVIATIONS[run].items():
        cells = [PUBLISHED_CONTROLLERS.get(row, row)]
        for signal, published in zip(signals, printed, strict=True):
            ours = float(found.sel(row=row, signal=signal))
            gap = f"{100 * (ours / published - 1):+.2g} %" if published else "–"
            cells += [f"{published:.5g}", f"{ours:.5g}", gap]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def same_load() -> str:
    """Compare the printed controllers and ours under the well-posed brush."""
    plants = {
        kind: rp.air_bearing(actuation=kind).with_full_state() for kind in ("displacement", "force")
    }
    designs = {}
    for name in ("first", "first_scaled", "second", "second_scaled"):
        plant = plants["displacement" if name.startswith("first") else "force"]
        designs[PUBLISHED_CONTROLLERS[name]] = rp.given_controller(plant, published_gain(name))
    designs["ours, force, 1e-7 m/N"] = rp.state_feedback(plants["force"], control_weight=1e-7)
    return under_the_brush(designs)


def structures(actuation: Literal["force", "displacement"]) -> str:
    """Compare dynamic, static and observer-based output feedback with state feedback."""
    return under_the_brush(thesis_structures(actuation))


def under_the_brush(designs: Mapping[str, rp.results.Design]) -> str:
    """Tabulate the largest deviations under runs 1 and 4 of the well-posed brush."""
    lines = [
        "| controller | norm [m/N] | run 1: x | y | z | run 4: x | y | z |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    first = next(iter(designs.values())).plant
    norms = {"without control": rp.hinf_norm(first.open_loop).value}
    norms |= {name: design.certificate.achieved for name, design in designs.items()}
    cells = {name: [f"{value:.4g}"] for name, value in norms.items()}
    for run in (1, 4):
        load = rp.polishing.simulate_brush(run=run)
        table = rp.compare_controllers(designs, load, signals=("x", "y", "z")).table
        for row in table["row"].to_numpy():
            deviation = table["deviation"].sel(row=row).to_numpy()
            gain = table["improvement"].sel(row=row).to_numpy()
            cells[str(row)] += [
                f"{1e6 * d:.3g}\N{NO-BREAK SPACE}µm ({g:+.2f}\N{NO-BREAK SPACE}%)"
                for d, g in zip(deviation, gain, strict=True)
            ]
    lines += [f"| {row} | " + " | ".join(texts) + " |" for row, texts in cells.items()]
    return "\n".join(lines)


def one_by_one() -> str:
    """Solve the three axes one by one and all twelve states at once."""
    lines = [
        "| actuation | price, noise | three axes | twelve states at once | difference |",
        "|---|---|---:|---:|---:|",
    ]
    for actuation, price in (("force", 1e-7), ("displacement", 1e-8)):
        plant = rp.air_bearing(actuation=actuation, measured="displacement")
        axes, whole = (
            rp.output_feedback(
                plant, control_weight=price, measurement_noise=1e-8, time_limit=20, split=split
            ).certificate.achieved
            for split in (True, False)
        )
        lines.append(
            f"| {actuation} | {price:g}, 1e-8 | {axes:.6g} | {whole:.6g} | "
            f"{100 * (whole / axes - 1):+.1g} % |"
        )
    return "\n".join(lines)


def steady_force() -> str:
    """Return the norm that displacement actuation reaches, and the limit."""
    plant = rp.air_bearing(actuation="displacement", measured="displacement")
    found = rp.output_feedback(plant).certificate.achieved
    limit = math.sqrt(2) / rp.polishing.AirBearingParameters.as_published().k_A
    return f"{found:.5g} m/N, and the limit is {limit:.5g} m/N"


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
    """Fill the template."""
    values = {
        "machine": table(machine()),
        "open_loop": table(open_loop()),
        "controllers": table(controllers()),
        "run_1": chapter_11(1),
        "run_4": chapter_11(4),
        "same_load": same_load(),
        "structures_force": structures("force"),
        "structures_displacement": structures("displacement"),
        "one_by_one": one_by_one(),
        "steady_force": steady_force(),
        **dict(validation_moulds.values()),
        **dict(validation_rotors.values()),
        **dict(validation_contact.values()),
    }
    template = jinja2.Template(PAGE.with_suffix(".md.in").read_text(), keep_trailing_newline=True)
    PAGE.write_text(template.render(values), encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
