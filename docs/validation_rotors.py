"""The parts of docs/validation.md on the spindle as a rotating beam and on equivalent damping."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import robustpolish as rp
from robustpolish.machines.effects.effect import Effect

# Rotors whose natural frequencies are printed in a book.
#
# Friswell, Penny, Garvey, Lees (2010), Dynamics of rotating machines, Cambridge: examples 5.9.1,
# 5.9.2, 5.9.5 and 5.9.9, in the digits in which ross (petrobras/ross, ross/tests/test_examples.py)
# holds its own results to them.

FAST = 4000 * math.pi / 30
"""4000 rev/min in rad/s."""
SHAFT = [rp.rotor.ShaftSegment(1.5, 0.05, elements=6)]
LEFT = rp.rotor.RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05)
RIGHT = rp.rotor.RotorDisc.cylinder(1.0, diameter=0.35, width=0.07, bore=0.05)


DISCS = [LEFT, RIGHT]


def _ends(*bearing: float | tuple[float, float], span: float = 1.5) -> list[rp.rotor.RotorBearing]:
    return [rp.rotor.RotorBearing(at, *bearing) for at in (0.0, span)]


ISOTROPIC = rp.rotor.RotorModel(SHAFT, DISCS, _ends(1e6))
ANISOTROPIC = rp.rotor.RotorModel(SHAFT, DISCS, _ends((1e6, 8e5)))
DAMPED = rp.rotor.RotorModel(SHAFT, DISCS, _ends(1e6, 3e3))
OVERHUNG = rp.rotor.RotorModel(SHAFT, [replace(RIGHT, position=1.5)], _ends(1e7, span=1.0))

IN_RAD: dict[str, tuple[rp.rotor.RotorModel, float, list[float]]] = {
    "5.9.1 at rest": (ISOTROPIC, 0.0, [86.66, 86.66, 274.31, 274.31, 716.78, 716.78]),
    "5.9.1": (ISOTROPIC, FAST, [85.39, 87.80, 251.78, 294.71, 600.18, 827.08]),
    "5.9.2 at rest": (ANISOTROPIC, 0.0, [82.65, 86.66, 254.52, 274.31, 679.49, 716.79]),
    "5.9.2": (ANISOTROPIC, FAST, [82.33, 86.86, 239.64, 287.25, 583.49, 806.89]),
    "5.9.9 at rest": (OVERHUNG, 0.0, [90.14, 90.14, 630.73, 630.73, 830.43, 830.43]),
    "5.9.9": (OVERHUNG, FAST, [76.19, 103.91, 565.99, 634.23, 647.75, 1174.2]),
}
"""Undamped natural frequencies in rad/s."""
DAMPED_HZ: dict[float, tuple[list[float], list[float]]] = {
    0.0: ([13.91, 13.91, 48.18, 48.18, 137.06, 137.06],
          [13.89, 13.89, 46.54, 46.54, 103.22, 103.22]),
    FAST: ([13.70, 14.09, 43.61, 52.18, 122.37, 149.81],
           [13.68, 14.07, 41.98, 50.65, 104.25, 105.66]),
}  # fmt: skip
"""Of 5.9.5: natural frequencies (magnitudes) and those of the oscillations, in Hz."""

CLAMP = rp.rotor.RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
ROOTS = {
    "clamped": ([CLAMP], [1.87510407, 4.69409113, 7.85475744]),
    "simply supported": (
        [rp.rotor.RotorBearing(at, math.inf) for at in (0.0, 1.0)],
        [math.pi, 2 * math.pi, 3 * math.pi],
    ),
    "free": ([], [4.73004074, 7.85320462, 10.99560784]),
}


def _lowest(rotor: rp.rotor.RotorModel, speed: float = 0.0) -> np.ndarray:
    return 2 * np.pi * rotor.modes(speed, count=6).frequencies_hz


def _percent(found: np.ndarray, expected: np.ndarray) -> str:
    return f"{100 * float(np.abs(found / expected - 1).max()):.2g} %"


def closed_forms() -> str:
    """Return a table of beams against their closed forms, 20 elements."""
    lines = [
        "| beam of 20 elements | three lowest, closed form [rad/s] | largest gap |",
        "|---|---|---:|",
    ]
    slender = rp.rotor.ShaftSegment(1.0, 0.004, elements=20)
    unit = math.sqrt(slender.bending_stiffness / (slender.density * slender.area))
    for name, (bearings, roots) in ROOTS.items():
        expected = unit * np.square(roots)
        for theory in ("euler", "timoshenko"):
            found = _lowest(rp.rotor.RotorModel([slender], bearings=bearings, theory=theory))[::2]
            shown = ", ".join(f"{value:.5g}" for value in expected)
            lines.append(f"| {name}, l/d = 250, {theory} | {shown} | {_percent(found, expected)} |")
    for slenderness in (12.5, 10.0):
        rod = rp.rotor.ShaftSegment(1.0, 1.0 / slenderness, elements=20)
        expected = np.array([_timoshenko(rod, n * math.pi) for n in (1, 2, 3)])
        pins = ROOTS["simply supported"][0]
        found = _lowest(rp.rotor.RotorModel([rod], bearings=pins))[::2]
        shown = ", ".join(f"{value:.5g}" for value in expected)
        gap = _percent(found, expected)
        lines.append(f"| simply supported, l/d = {slenderness:g}, timoshenko | {shown} | {gap} |")
    return "\n".join(lines)


def _timoshenko(rod: rp.rotor.ShaftSegment, b: float) -> float:
    """Return the lower root of E I b^4 - (A + I b^2 (1 + E/kG)) rho w^2 + rho^2 I w^4 / kG."""
    soft = 1 / (rod.shear_coefficient * rod.shear_modulus)
    turning = rod.density * rod.area_moment
    middle = rod.density * rod.area + turning * b**2 * (1 + rod.young_modulus * soft)
    squares = np.roots([turning * rod.density * soft, -middle, rod.bending_stiffness * b**4])
    return math.sqrt(squares.min())


def published() -> str:
    """Return a table of printed natural frequencies and ours."""
    lines = [
        "| example | rev/min | printed [rad/s] | robustpolish [rad/s] | largest gap |",
        "|---|---:|---|---|---:|",
    ]
    for name, (rotor, speed, printed) in IN_RAD.items():
        found = _lowest(rotor, speed)
        shown = (", ".join(f"{value:.6g}" for value in row) for row in (printed, found))
        first, second = shown
        gap = _percent(found, np.array(printed))
        example = name.removesuffix(" at rest")
        lines.append(f"| {example} | {speed * 30 / math.pi:.0f} | {first} | {second} | {gap} |")
    for speed, (_, printed) in DAMPED_HZ.items():
        values = 2 * np.pi * np.array(printed)
        found = _lowest(DAMPED, speed)
        first, second = (", ".join(f"{value:.5g}" for value in row) for row in (values, found))
        gap = _percent(found, values)
        lines.append(f"| 5.9.5 | {speed * 30 / math.pi:.0f} | {first} | {second} | {gap} |")
    return "\n".join(lines)


def campbell() -> str:
    """Return how the Campbell diagram of 5.9.1 agrees, followed from rest to 4000 rev/min."""
    rotor, speed, printed = IN_RAD["5.9.1"]
    found = rotor.campbell(np.linspace(0.0, speed, 41), count=6)
    gap = _percent(np.sort(2 * np.pi * found.frequencies_hz[-1]), np.array(printed))
    rpm = ", ".join(f"{value * 30 / math.pi:.1f}" for value in found.critical_speeds)
    return f"{gap} at {FAST * 30 / math.pi:.0f} rev/min, and critical speeds at {rpm} rev/min"


def spindle() -> str:
    """Return the table from the lumped spindle to the beam."""
    given = {"theory": "euler", "brush": "point", "bearing": "reduced", "density": 0.0}
    steps = {
        "the thesis's assumptions": {},
        "the rod has its mass, 7850 kg/m^3": {"density": 7850.0},
        "and yields to shear": {"theory": "timoshenko"},
        "the brush is a disc, its middle 5 mm behind the rod": {"brush": "disc"},
        "the bearing is a body that tilts on its film": {"bearing": "rigid"},
    }
    lines = ["| spindle, at rest | 1st [Hz] | 2nd [Hz] | 3rd [Hz] |", "|---|---:|---:|---:|"]
    for name, step in steps.items():
        given |= step
        found = rp.polishing.spindle_rotor(**given).modes(count=6).frequencies_hz[::2]
        cells = [f"{value:.2f}" for value in found] + ["–"] * (3 - len(found))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def spinning() -> str:
    """Return what the spin does, and what the reduced plant loses."""
    rotor = rp.polishing.spindle_rotor()
    backward, forward = rotor.modes(314.0, count=2)
    p = rp.polishing.AirBearingParameters()
    ports = [-p.bearing_height / 2, p.rod_length + p.brush_height / 2]
    lost = rotor.reduced(2, ports, speed=314.0).error(band_hz=2000.0)
    states = (
        rp.polishing.rotating_beam(speed=314.0).nx,
        rp.polishing.rotating_beam(speed=314.0, modes=None).nx,
    )
    return (
        f"At 3000 rev/min the lowest mode is {backward.frequency_hz:.2f} Hz against the spin and "
        f"{forward.frequency_hz:.2f} Hz with it, with the damping ratios "
        f"{backward.damping_ratio:.3g} and {forward.damping_ratio:.3g}. The first critical speed "
        f"is {rotor.critical_speeds()[0] * 30 / math.pi:.0f} rev/min. `rp.polishing.rotating_beam` "
        "has "
        f"{states[0]} states where the whole beam has {states[1]}, and loses at most "
        f"{lost.response:.1e} of the response below 2 kHz"
    )


def damping() -> str:
    """Return a table of integrated energies per cycle against their closed forms."""
    A, w = 1e-3, 1000.0
    cases = {
        "Coulomb, 4 F A": ("coulomb_friction", {"force": 3.0}, 4 * 3.0 * A),
        "velocity squared, 8/3 b w^2 A^3": (
            "quadratic_damping",
            {"coefficient": 2.0},
            8 / 3 * 2.0 * w**2 * A**3,
        ),
        "structural, 2 h A^2": ("structural_damping", {"loss": 5.0}, 2 * 5.0 * A**2),
    }
    lines = ["| loss per cycle | closed form [J] | integrated [J] | gap |", "|---|---:|---:|---:|"]
    for name, (kind, values, closed) in cases.items():
        found = rp.effects.energy_per_cycle(Effect(kind, ("x", "ground"), values), A, w)
        lines.append(f"| {name} | {closed:.6g} | {found:.6g} | {abs(found / closed - 1):.1e} |")
    return "\n".join(lines)


def values() -> Iterator[tuple[str, str]]:
    """Yield what the template asks for, by name."""
    makers = (closed_forms, published, campbell, spindle, spinning, damping)
    yield from ((f"rotor_{maker.__name__}", maker()) for maker in makers)
