"""A rotor with named forces and displacements, as a plant that every synthesis takes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.models.plant.plant import GeneralizedPlant
from robustpolish.models.rotor.second_order import SecondOrder
from robustpolish.validation import instance_of, invalid

AXES = ("x", "y")


def state_space(
    system: SecondOrder, speed: float, forces: Matrix, seen: Matrix
) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B and C from forces at some places to displacements at others.

    Parameters
    ----------
    system : SecondOrder
    speed : float
        In rad/s.
    forces, seen : ndarray, shapes (inputs, n) and (outputs, n)
        Rows of displacements.

    Returns
    -------
    A, B, C : ndarray
    """
    A = system.state_matrix(speed)
    shapes, m = system.normal_modes[1], len(A) // 2
    B, C = np.zeros((len(A), len(forces))), np.zeros((len(seen), len(A)))
    B[m:] = (forces @ shapes).T
    C[:, :m] = seen @ (shapes / system.state_scale)
    return A, B, C


def mode_names(system: SecondOrder) -> list[str]:
    """Return names of the states: displacement and rate of each normal coordinate."""
    count = len(system.state_scale)
    return [f"{prefix}mode{k + 1}" for prefix in ("", "d") for k in range(count)]


def rotor_plant(
    system: SecondOrder,
    speed: float,
    rows: Mapping[str, Mapping[str, Matrix]],
) -> GeneralizedPlant:
    """Return the plant of a rotor.

    Parameters
    ----------
    system : SecondOrder
    speed : float
    rows : mapping of str to mapping of str to ndarray, shape (2, n)
        Of "loads", "actuators", "performance" and "sensors": x and y at each named place.

    Returns
    -------
    GeneralizedPlant
    """
    prefixes = {"loads": "F_", "actuators": "u_", "performance": "", "sensors": "measured_"}
    names = {
        role: [f"{prefixes[role]}{name}_{axis}" for name in places for axis in AXES]
        for role, places in rows.items()
    }
    stacked = {role: np.vstack(list(places.values())) for role, places in rows.items()}
    forces = np.vstack([stacked["loads"], stacked["actuators"]])
    seen = np.vstack([stacked["performance"], stacked["sensors"]])
    A, B, C = state_space(system, speed, forces, seen)
    nw, nz = len(stacked["loads"]), len(stacked["performance"])
    units = {name: "N" for role in ("loads", "actuators") for name in names[role]}
    units |= {name: "m" for role in ("performance", "sensors") for name in names[role]}
    return GeneralizedPlant.from_matrices(
        A,
        B[:, :nw],
        B[:, nw:],
        C[:nz],
        C[nz:],
        states=mode_names(system),
        disturbances=names["loads"],
        controls=names["actuators"],
        performance=names["performance"],
        measurements=names["sensors"],
        units=units,
    )


def named_places(argument: str, given: Mapping[str, float]) -> dict[str, float]:
    """Return places by name, checked.

    Parameters
    ----------
    argument : str
    given : mapping of str to float

    Returns
    -------
    dict

    Raises
    ------
    InvalidInputError
    """
    instance_of(argument, given, Mapping, "places by name", "Write {'tip': 0.02}.")
    if not given:
        raise invalid(argument, given, "at least one place", "Write {'tip': 0.02}.")
    found: dict[str, float] = {}
    for name, place in given.items():
        try:
            found[str(name)] = float(place)
        except (TypeError, ValueError):
            raise invalid((argument, str(name)), place, "a place in m", "Write 0.02.") from None
        if not np.isfinite(found[str(name)]):
            raise invalid((argument, str(name)), place, "a finite place in m", "Check it.")
    return found
