"""Contact laws, brush and machine together: what `build_validation.py` tells of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import control
import numpy as np
import xarray as xr

import robustpolish as rp
from robustpolish.polishing import contact as disc_motion
from robustpolish.polishing.brush import contact_constants, motion_constants
from robustpolish.polishing.contact import rim_nodes

STUDY_SECONDS = 0.1


def force_study() -> str:
    """Change one thing at a time in the listing, in runs 1 and 4."""
    studies = {run: rp.polishing.force_study(run, STUDY_SECONDS).table for run in (1, 4)}
    lines = [
        "| changed | suspect |"
        + "".join(f" run {run}: peak [N] | factor | 10 ms |" for run in studies),
        "|---|---|" + "---:|" * 6,
    ]
    for i, row in enumerate(studies[1]["row"].values):
        cells = [str(row).replace("_", "\\_"), str(studies[1]["suspect"].values[i])]
        for found in studies.values():
            cells += [f"{float(found[key][i]):.3g}" for key in ("peak", "factor", "impulse")]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def impact_law() -> str:
    """Ask the solver of the listing to be more and more careful."""
    lines = ["| tolerance | steps | largest F_z [N] |", "|---:|---:|---:|"]
    for tolerance in (1e-3, 1e-4, 1e-5):
        listed = rp.polishing.simulate_brush("listing", 1, 0.05, tolerance=tolerance)
        largest = float(abs(listed["F_z"]).max())
        lines.append(f"| {tolerance:.0e} | {listed.attrs['steps']} | {largest:.1f} |")
    return "\n".join(lines)


def mean_of_the_contact(simulator: Literal["physical", "listing"]) -> str:
    """Return what the mould carries on average over the first 0.4 s of run 1."""
    return f"{float(rp.polishing.simulate_brush(simulator, 1, 0.4)['F_z'].mean()):.1f} N"


def critical_springs(stiffness: float, mass: float = 0.2) -> control.StateSpace:
    """Return a mass on three springs with critical damping, signs as (8.45)."""
    damping = 2.0 * math.sqrt(stiffness * mass)
    A = np.kron(np.eye(3), [[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    B = np.kron(np.diag([-1.0, -1.0, 1.0]) / mass, [[0.0], [1.0]])
    C = np.kron(np.eye(3), [[1.0, 0.0]])
    names = {"inputs": ["F_x", "F_y", "F_z"], "outputs": ["x", "y", "z"]}
    return control.ss(A, B, C, 0, **names)


def coupled() -> str:
    """Compare replayed and coupled runs over the stiffness of the machine."""
    lines = [
        "| contact damping [s/m] | k [N/m] | stiffer at rest | where it matters | difference |",
        "|---:|---:|---:|---:|---:|",
    ]
    for damping in (50.0, 1.0):
        parameters = rp.polishing.BrushParameters(contact_damping=damping)
        brush = rp.polishing.simulate_brush(duration=0.1, parameters=parameters, tolerance=5e-3)
        for stiffness in (1e4, 1e5, 1e6, 1e7, 1e8):
            found = rp.polishing.compare_coupled(critical_springs(stiffness), brush)
            lines.append(
                f"| {damping:g} | {stiffness:.0e} | {found.stiffness_ratio:.3g} | "
                f"{1 / found.loop_gain:.3g} | {100 * found.largest_share:.2g} % |"
            )
    return "\n".join(lines)


def with_brush() -> str:
    """Tabulate the slowest or fastest growing poles of brush and machine."""
    bare = rp.air_bearing(actuation="force")
    loops = {
        "without control": bare,
        "state feedback, 1e-7 m/N": rp.state_feedback(bare, control_weight=1e-7),
    }
    lines = ["| loop |" + "".join(f" run {run} |" for run in (1, 2, 3, 4)), "|---|" + "---:|" * 4]
    for name, loop in loops.items():
        cells = [name]
        for run in (1, 2, 3, 4):
            parameters = rp.polishing.BrushParameters.for_run(run)
            poles = rp.polishing.linearize_with_brush(loop, parameters).system.poles()
            pole = poles[np.argmax(poles.real)]
            hertz = abs(pole.imag) / (2.0 * math.pi)
            cells.append(f"{pole.real:+.3g} 1/s at {hertz:.3g} Hz")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def audits() -> str:
    """Measure the free disc's energy and momentum, and a record that goes round."""
    energy, momentum = free_disc()
    brush = rp.polishing.simulate_brush(run=1, duration=0.1, sample_rate=40e3)
    names = {name: name for name in ("F_x", "F_y", "F_z")}
    kilo = xr.Dataset(
        {name: ("time", brush[name].to_numpy() / 1e3, {"units": "kN"}) for name in names},
        {"time": brush["time"]},
    )
    load = rp.signals.measured_forces(kilo, names, steady={"F_p": 10.0}, sample_rate=20e3)
    first = round(40e3 * load.attrs["began"])
    direct = brush.isel(time=slice(first, None, 2)).isel(time=slice(0, load.sizes["time"]))
    direct = direct.assign_coords(time=load["time"])
    apart = [rp.simulate(rp.air_bearing(), given)["y"] for given in (load, direct)]
    share = float(abs(apart[0] - apart[1]).max() / abs(apart[1]).max())
    return "\n".join(
        [
            f"| tilting energy of the free disc, change over 0.1 s, both models | {energy:.1g} |",
            f"| its angular momentum | {momentum:.1g} |",
            "| displacement under a record of the brush's forces (40 kHz in kN, made 20 kHz in N), "
            f"against the forces themselves | {100 * share:.2g} % |",
        ]
    )


def free_disc() -> tuple[float, float]:
    """Follow the disc of both models without a moment; relative drift of energy and momentum."""
    parameters = rp.polishing.BrushParameters()
    drifts = []
    for three_angles in (False, True):
        motion = motion_constants(replace(parameters, spindle_damping=1e-300), three_angles)
        state = np.zeros(disc_motion.STATES)
        state[disc_motion.HEIGHT], state[disc_motion.SPIN] = 100.0, parameters.spin
        state[disc_motion.AXES] = [math.sin(0.4), 0.0, math.cos(0.4)]
        state[disc_motion.TURNINGS] = np.cross(state[disc_motion.AXES], [0.0, 5.0, -8.0])
        track, midway = np.empty((201, disc_motion.STATES)), np.empty((200, 3))
        loads = np.empty((201, disc_motion.LOADS))
        disc_motion.advance(
            state, 5e-4, 5e-5, 1e-12, np.ones(disc_motion.STATES), motion,
            contact_constants(parameters), rim_nodes(64), track, loads, midway,
        )  # fmt: skip
        turning, spin = track[:, disc_motion.TURNINGS], track[:, disc_motion.SPIN]
        # That of the spin is a constant, and so large that it would hide any change.
        energy = np.sum(turning**2, axis=1)
        momentum = parameters.tilt_inertia * turning
        momentum = momentum + parameters.spin_inertia * spin[:, None] * track[:, disc_motion.AXES]
        size = np.linalg.norm(momentum[0])
        drifts.append(
            (
                np.max(np.abs(energy / energy[0] - 1.0)),
                np.max(np.abs(momentum - momentum[0])) / size,
            )
        )
    energies, momenta = zip(*drifts, strict=True)
    return float(max(energies)), float(max(momenta))


def values() -> Iterator[tuple[str, str]]:
    """Yield what the template asks for, by name."""
    yield "study_seconds", f"{STUDY_SECONDS:g}"
    yield "impact_mean", mean_of_the_contact("listing")
    yield "physical_mean", mean_of_the_contact("physical")
    makers = (impact_law, force_study, coupled, with_brush, audits)
    yield from ((maker.__name__, maker()) for maker in makers)
