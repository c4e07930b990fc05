"""Modes that no controller of a given structure can move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robustpolish.errors import InfeasibleError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import FixedMode
from robustpolish.synthesis.problem.static_loop import close_static

# A mode that random gains move by less than this share of the state matrix is fixed.
_MOVED = 1e-7
_GAINS = 5


def unstable_fixed_modes(
    loop: PlantMatrices,
    mask: NDArray[np.bool_],
    states: Sequence[str],
    unit_of_time: float = 1.0,
) -> tuple[FixedMode, ...]:
    """Find unstable eigenvalues of A + B2 K C2 common to all K with the given pattern.

    With all entries free these are the modes that are uncontrollable or unobservable;
    with a pattern they are the fixed modes of Wang and Davison (1973), found as they propose:
    by gains drawn at random.

    Parameters
    ----------
    loop : PlantMatrices
        Scaled, so that entries of K of order one matter.
    mask : ndarray of bool, shape (nu, ny)
        True where K is free.
    states : sequence of str
        Names of x.
    unit_of_time : float
        Unit of the loop's time in s.

    Returns
    -------
    tuple of FixedMode
        One of each complex pair; what it lacks is a gain of the structure that moves it.
    """
    found = np.linalg.eig(loop.A)
    values, vectors = np.asarray(found[0], complex), np.asarray(found[1])
    size = float(np.linalg.norm(loop.A, 2)) if loop.A.size else 0.0
    margin = np.abs(values) - 1 if loop.discrete else np.real(values)
    suspects = [
        i for i in range(len(values)) if margin[i] >= -_MOVED * size and values[i].imag >= 0
    ]
    rng = np.random.default_rng(0)
    for scale in np.logspace(-1, 1, _GAINS):
        if not suspects:
            break
        closed = close_static(loop, np.where(mask, scale * rng.normal(size=mask.shape), 0.0))
        if closed is None:
            continue
        suspects = [i for i in suspects if np.abs(closed.poles - values[i]).min() <= _MOVED * size]
    return tuple(
        FixedMode(
            eigenvalue=complex(values[i] / unit_of_time),
            state=states[int(np.argmax(np.abs(vectors[:, i])))],
            lack="immovable",
            distance=0.0,
            exact=True,
        )
        for i in suspects
    )


def refuse_fixed_modes(
    loop: PlantMatrices,
    mask: NDArray[np.bool_],
    states: Sequence[str],
    unit_of_time: float,
    what: str = "static gain",
) -> None:
    """Raise an InfeasibleError if an unstable mode is fixed.

    Parameters
    ----------
    loop, mask, states, unit_of_time
        As in :func:`unstable_fixed_modes`.
    what : str
        What is designed, for the message.
    """
    found = unstable_fixed_modes(loop, mask, states, unit_of_time)
    if not found:
        return
    unit = "" if loop.discrete else " rad/s"
    named = ", ".join(f"{mode.value_text}{unit} (state {mode.state})" for mode in found)
    kind = "of this structure " if not mask.all() else ""
    raise InfeasibleError(
        f"No {what} {kind}stabilises the plant: no gain moves the mode {named}. "
        "Add an actuator or a sensor that reaches it"
        + (", or free more entries of the structure." if kind else "."),
        [mode.eigenvalue for mode in found],
    )


def refuse_unstable(plant: GeneralizedPlant) -> None:
    """Raise an InfeasibleError unless a part without control is stable by itself."""
    if not plant.nx:
        return
    found = np.linalg.eig(plant.A)
    poles, vectors = np.asarray(found[0], complex), np.asarray(found[1])
    margin = np.abs(poles) - 1 if plant.is_discrete else np.real(poles)
    worst = int(np.argmax(margin))
    if margin[worst] >= 0:
        state = plant.states[int(np.argmax(np.abs(vectors[:, worst])))]
        raise InfeasibleError(
            f"No controller stabilises the plant: nothing joins the mode {poles[worst]:.6g} "
            f"(state {state}) to a control and a measurement. Add an actuator and a sensor there.",
            [complex(poles[worst])],
        )
