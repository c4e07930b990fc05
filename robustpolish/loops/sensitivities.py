"""S, T, KS and GS where a loop is broken, with their peaks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import control
import numpy as np

from robustpolish.analysis import HinfNorm
from robustpolish.loops.loop import Loop, Place, norm_of
from robustpolish.models.plant.blocks import named_system


@dataclass(frozen=True, eq=False)
class Sensitivities:
    """The transfer functions of a loop at one break point, as named systems.

    With u = K y and y = G u the loop transfer function is L = -K G at the plant's input and
    L = -G K at its output. Peaks are H-infinity norms: for several signals they depend on units,
    as every singular value does.

    Attributes
    ----------
    place : {"input", "output"}
        Of the plant.
    L : control.StateSpace
        Loop transfer function, all signals of the place broken.
    S : control.StateSpace
        Sensitivity, 1/(1 + L): from a disturbance at the place to the signal behind it.
    T : control.StateSpace
        Complementary sensitivity, 1 - S.
    KS : control.StateSpace
        From noise on the measurements to the controls, K (1 - G K)^-1; the same at both places.
    GS : control.StateSpace
        From disturbances at the controls to the measurements, G (1 - K G)^-1; the same at both.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> loop = rp.loop_analysis(control.tf([2], [1, 1]), -4).output
    >>> [round(complex(system(0)).real, 4) for system in (loop.S, loop.T, loop.KS, loop.GS)]
    [0.1111, 0.8889, -0.4444, 0.2222]
    >>> round(loop.peaks["S"].value, 6)
    1.0
    """

    place: Place
    L: control.StateSpace
    S: control.StateSpace
    T: control.StateSpace
    KS: control.StateSpace
    GS: control.StateSpace

    @cached_property
    def peaks(self) -> dict[str, HinfNorm]:
        """Largest singular values over all frequencies of S, T, KS and GS, proven if affordable."""
        return {name: norm_of(getattr(self, name)) for name in ("S", "T", "KS", "GS")}


def sensitivities(loop: Loop, place: Place) -> Sensitivities:
    """Return the transfer functions of a loop at a place."""
    at, u, y = loop.at(place), loop.at("input"), loop.at("output")
    return Sensitivities(
        place=place,
        L=loop.opened(place),
        S=loop.around(at),
        T=loop.around(at, -1.0, -1.0),
        KS=from_to(loop.closed, y, u),
        GS=from_to(loop.closed, u, y),
    )


def from_to(
    system: control.StateSpace, inputs: Sequence[int], outputs: Sequence[int]
) -> control.StateSpace:
    """Return a system between some of its inputs and outputs."""
    A, B, C, D = (np.asarray(getattr(system, name)) for name in "ABCD")
    matrices = A, B[:, inputs], C[outputs], D[np.ix_(outputs, inputs)]
    return named_system(
        matrices,
        0 if system.dt is None else system.dt,
        [system.input_labels[i] for i in inputs],
        [system.output_labels[i] for i in outputs],
        system.state_labels,
    )
