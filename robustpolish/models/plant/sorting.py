"""Which signals of a system are controls or measurements: by name or by number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.measured import rearranged
from robustpolish.validation import described, invalid, is_whole

Chosen = int | str | Sequence[str]


def sorted_signals(system: Any, measurements: Chosen, controls: Chosen) -> tuple[Any, int, int]:
    """Put measurements behind the other outputs and controls behind the other inputs.

    Parameters
    ----------
    system : control.StateSpace or control.FrequencyResponseData
    measurements, controls : int, str or sequence of str
        Number of the last outputs or inputs, or names of some, wherever they stand; they get the
        order in which they are named.

    Returns
    -------
    system : control.StateSpace or control.FrequencyResponseData
        The system itself if nothing had to be moved.
    measurements, controls : int
        Their numbers.

    Raises
    ------
    InvalidInputError
        If a number does not fit, or a name is unknown or doubled.
    """
    outs, ny = _order("measurements", measurements, system.output_labels, "outputs")
    ins, nu = _order("controls", controls, system.input_labels, "inputs")
    if outs == sorted(outs) and ins == sorted(ins):
        return system, ny, nu
    if isinstance(system, control.FrequencyResponseData):
        return rearranged(system, outs, ins), ny, nu
    n = system.nstates
    A, B, C, D = (np.asarray(getattr(system, name)) for name in "ABCD")
    B, C = B.reshape(n, len(ins)), C.reshape(len(outs), n)
    moved = named_system(
        (A, B[:, ins], C[outs], D[np.ix_(outs, ins)]),
        0 if system.dt is None else system.dt,
        [system.input_labels[i] for i in ins],
        [system.output_labels[i] for i in outs],
        system.state_labels,
    )
    return moved, ny, nu


def _order(argument: str, given: Any, labels: Sequence[str], what: str) -> tuple[list[int], int]:
    """Return the order of all signals with the chosen ones last, and how many these are."""
    count = len(labels)
    whole = is_whole(given)
    if whole and 0 <= given <= count:
        return list(range(count)), int(given)
    if whole or given is None or isinstance(given, bool | float):
        raise invalid(
            argument,
            given,
            f"a whole number from 0 to {count}, the system's number of {what}, or names",
            f"Count the {what} at the end of the list, or name them.",
        )
    names = chosen_names(argument, given, labels, what)
    chosen = [labels.index(name) for name in names]
    return [*(i for i in range(count) if i not in chosen), *chosen], len(chosen)


def chosen_names(argument: str, given: Any, labels: Sequence[str], what: str) -> list[str]:
    """Return names that are all known and different; a single one may stand for itself."""
    try:
        names = [given] if isinstance(given, str) else list(given)
    except TypeError:
        names = [given]
    listed = ", ".join(labels) or "none"
    for name in names:
        if not isinstance(name, str) or name not in labels:
            want = f"names among the system's {what}: {listed}"
            raise invalid(argument, name, want, "Check its spelling, or give a number of signals.")
    if len(set(names)) != len(names):
        shown = described(f"{', '.join(names)}, with a name twice")
        raise invalid(argument, shown, "different names", "Name each signal once.")
    return names
