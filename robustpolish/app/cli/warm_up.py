"""`robustpolish warm-up`: the command, and what it calls."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import click
import control
import numpy as np
import trimesh

import robustpolish as rp
from robustpolish.base.budget import progress_bar
from robustpolish.datasets import sticky_slide
from robustpolish.errors import RobustPolishWarning
from robustpolish.machines.effects.effect import kinds, lookup
from robustpolish.machines.effects.evaluate import compiled_law
from robustpolish.machines.effects.kind import EffectKind
from robustpolish.machines.effects.spline_law import spline_basis
from robustpolish.machines.simulation import simulate_model
from robustpolish.polishing.thesis.listing import listing_response

# A small call for every kind of compiled function, so that all of them are compiled and kept.

SECONDS = 0.005
"""Of the brush's runs: what is compiled does not depend on it."""
SAMPLES = 200
"""Of a measurement."""
LEARNED = (
    "learned_stiffness_9", "learned_damping_9", "learned_force_7x7",
    "learned_varying_stiffness_9", "learned_varying_damping_9",
)  # fmt: skip
"""One law of each shape; those with other numbers of knots share what takes long."""


def norms() -> None:
    """Scale systems with one and with several signals, and look for their peaks."""
    A = np.kron(np.diag(np.arange(1.0, 5.0)), [[-0.1, 1.0], [-1.0, -0.1]])
    for signals in (1, 3):
        matrices = np.ones((8, signals)), np.ones((signals, 8)), 0
        systems = control.StateSpace(A, *matrices), control.StateSpace(A / 5, *matrices, 0.1)
        for given in systems:
            for exact in (True, False):  # searches look at loops inexactly
                rp.hinf_norm(given, exact=exact)
            rp.h2_norm(given)
            rp.linear.prescale(given)


def brush_on_a_trough() -> None:
    """Run all discs, and the machine that yields."""
    run = rp.polishing.simulate_brush(duration=SECONDS)
    rp.polishing.simulate_brush(duration=SECONDS, disc="three-angle", start="landing")
    rp.polishing.simulate_disc([0.0, SECONDS], np.zeros((2, 3)))
    machine = rp.air_bearing()
    rp.simulate(machine, run)
    rp.polishing.simulate_coupled(machine, run)


def brush_on_a_mould() -> None:
    """Run the disc along a path on splines, and draw a mesh of two triangles."""
    bowl = rp.polishing.Mould.from_formula("x**2 / 0.1", x=(-0.06, 0.06), y=(-0.06, 0.06))
    path = rp.polishing.ToolPath.through([[0.0, 0.0], [0.01, 0.0], [0.02, 0.0]], speed=0.01)
    rp.polishing.simulate_brush(duration=SECONDS, surface=bowl, path=path)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sheet.stl"
        corners = [[0, 0, 0], [9, 0, 0], [9, 9, 3], [0, 9, 3]]
        trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).export(file)
        rp.polishing.Mould.from_stl(file, unit="mm")


def thesis() -> None:
    """Run the thesis's brush, and its response."""
    brush = rp.polishing.simulate_brush("listing", run=1, duration=2 * SECONDS)
    A = np.kron(np.eye(6), [[0.0, 1.0], [-1e4, -20.0]])
    listing_response(A, np.eye(12)[:, 8:], np.eye(12)[[10]], brush)


def effects() -> None:
    """Compile the laws of the catalogue, and some that are learned."""
    for kind in (*kinds().values(), *map(lookup, LEARNED)):
        if isinstance(kind, EffectKind) and kind.law is not None:
            compiled_law(kind)
    spline_basis(np.linspace(0.0, 1.0, 20), 0.0, 1.0, 9)


def models() -> None:
    """Simulate, compare, refit and diagnose a short measurement."""
    model, data = sticky_slide()
    short = data.isel(time=slice(0, SAMPLES))
    simulate_model(model, short, initial_state=np.zeros(2))
    rp.residual_analysis(rp.compare(model, short))
    rp.diagnose(model, short)


CALLS: Mapping[str, Callable[[], None]] = {
    "norms": norms,
    "brush on a trough": brush_on_a_trough,
    "brush on a mould": brush_on_a_mould,
    "the thesis's brush": thesis,
    "effects": effects,
    "models and measurements": models,
}
"""What is compiled, by what it is for."""


# `robustpolish warm-up`.


@click.command("warm-up")
def warm_up() -> None:
    """Compile what is compiled on first use, and keep it for this user.

    Later runs of this version load it in a moment; once is enough.
    """
    start = time.perf_counter()
    with (
        progress_bar("Compiling (once)", len(CALLS), stages=True) as tell,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", RobustPolishWarning)  # of runs that nobody looks at
        for name, call in CALLS.items():
            tell(name)
            call()
    click.echo(f"Compiled code is ready ({time.perf_counter() - start:.1f} s).")
