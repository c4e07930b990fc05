"""A loop as the brush sees it: forces in, place of the joint out."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
import xarray as xr

from robustpolish.arrays import Vector
from robustpolish.brush.coupled.machine import LinearMachine
from robustpolish.closed_loop.simulation import loop_with_units
from robustpolish.implementation import SampledDesign
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.validation import described, invalid

PLACES = ("x", "y", "z")
FORCES = ("F_x", "F_y", "F_z")
SIGNS = np.array([-1.0, -1.0, 1.0])
"""Of the forces (8.45): F_x and F_y push the tool against their axes, F_z along its own."""

Loop = Design | GeneralizedPlant | control.StateSpace


@dataclass(frozen=True, eq=False)
class Carrier:
    """A loop, what it is for the brush, and the units of its signals.

    Attributes
    ----------
    system : control.StateSpace
        From the forces to all outputs.
    machine : LinearMachine
        The same from the contact force on the brush to its place.
    units : dict of str to str
    """

    system: control.StateSpace
    machine: LinearMachine
    units: dict[str, str]

    def inputs(self, forces: Vector, polishing_force: float) -> Vector:
        """Return the loop's inputs under contact forces on the brush along world axes.

        Parameters
        ----------
        forces : ndarray, shape (samples, 3)
            In N.
        polishing_force : float
            In N.

        Returns
        -------
        ndarray, shape (samples, m)
        """
        given = np.zeros((len(forces), self.system.ninputs))
        labels = self.system.input_labels
        for name, sign, column in zip(FORCES, SIGNS, forces.T, strict=True):
            given[:, labels.index(name)] = sign * column
        if "F_p" in labels:
            given[:, labels.index("F_p")] = polishing_force
        return given

    def labelled(self, time: Vector, outputs: Vector) -> xr.Dataset:
        """Return outputs over time with their names and units.

        Parameters
        ----------
        time : ndarray, shape (samples,)
            In s.
        outputs : ndarray, shape (samples, p)

        Returns
        -------
        xarray.Dataset
        """
        names = self.system.output_labels
        return xr.Dataset(
            {
                name: ("time", outputs[:, i], {"units": self.units.get(name, "")})
                for i, name in enumerate(names)
            },
            coords={"time": ("time", time, {"units": "s"})},
        )


def carrier(design: Loop, polishing_force: float) -> Carrier:
    """Read a loop as the machine that carries the brush.

    Parameters
    ----------
    design : Design, GeneralizedPlant or control.StateSpace
        In continuous time, with inputs F_x, F_y, F_z and perhaps F_p, signs as in (8.45), and
        outputs x, y, z, the displacements of the brush.
    polishing_force : float
        In N.

    Returns
    -------
    Carrier

    Raises
    ------
    InvalidInputError
        If the loop is sampled, lacks one of these signals, or a force moves the brush at once.
    """
    if isinstance(design, SampledDesign):
        shown, expected = described("a sampled design"), "a loop in continuous time"
        raise invalid("design", shown, expected, "Pass the design that was sampled.")
    system, units = loop_with_units(design)
    if not system.isctime(strict=False):
        raise invalid(
            "design",
            described("a loop in discrete time"),
            "one in continuous time",
            "Pass the design that was sampled.",
        )
    for kind, wanted, labels in (
        ("input", FORCES, system.input_labels),
        ("output", PLACES, system.output_labels),
    ):
        missing = [name for name in wanted if name not in labels]
        if missing:
            raise invalid(
                "design",
                described(f"{kind}s {', '.join(labels)}"),
                f"{', '.join(wanted)} among them",
                f"Name the {kind}s; {', '.join(missing)} is missing.",
            )
    rows = [system.output_labels.index(name) for name in PLACES]
    columns = [system.input_labels.index(name) for name in FORCES]
    A, B, C, D = (np.asarray(part) for part in (system.A, system.B, system.C, system.D))
    if np.any(D[np.ix_(rows, columns)]):
        raise invalid(
            "design",
            described("a brush that a force displaces at once"),
            "a brush with a mass",
            "Give the place where the brush hangs a mass.",
        )
    steady = np.zeros(system.nstates)
    if "F_p" in system.input_labels:
        steady = B[:, system.input_labels.index("F_p")] * polishing_force
    machine = LinearMachine(A, B[:, columns] * SIGNS, steady, C[rows])
    return Carrier(system, machine, units)
