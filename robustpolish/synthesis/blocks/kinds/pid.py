"""PID and its parts, with a filtered derivative."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.blocks.block import TunableBlock, block_of
from robustpolish.synthesis.blocks.slot import Given, Slot, checked_slot
from robustpolish.synthesis.blocks.stage import Stage
from robustpolish.validation import described, invalid, one_of

KINDS = ("P", "I", "D", "PI", "PD", "ID", "PID")


@dataclass(frozen=True, eq=False, kw_only=True)
class Pid(Stage):
    """Kp + Ki/s + Kd s/(Tf s + 1), or some of these terms.

    Attributes
    ----------
    terms : str
        Which: letters of "PID".
    """

    kind: ClassVar[str] = "pid"

    terms: str = "PID"

    @property
    def states(self) -> tuple[str, ...]:
        """The integral of the input, and the filtered input."""
        return self.integrators + (("filtered",) if "D" in self.terms else ())

    @property
    def integrators(self) -> tuple[str, ...]:
        """The integral of the input."""
        return ("integral",) if "I" in self.terms else ()

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        words = {"P": "Kp", "I": "Ki/s", "D": "Kd s/(Tf s + 1)"}
        text = " + ".join(words[term] for term in self.terms)
        return f"({text})" if len(self.terms) > 1 else text

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]: x1' = e, Tf x2' = e - x2, v = Kp e + Ki x1 + Kd x2'."""
        number = dict(zip((slot.name for slot in self.slots), values, strict=True))
        n = len(self.states)
        M = np.zeros((n + 1, n + 1))
        M[n, n] = number.get("Kp", 0.0)
        if "I" in self.terms:
            M[0, n] = 1.0
            M[n, 0] = number["Ki"]
        if "D" in self.terms:
            Kd, Tf = number["Kd"], number["Tf"]
            M[n - 1, n - 1], M[n - 1, n] = -1 / Tf, 1 / Tf
            M[n, n - 1] = -Kd / Tf
            M[n, n] += Kd / Tf
        return M

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over the numbers."""
        G, n = gradient, len(self.states)
        slopes = {"Kp": G[n, n], "Ki": G[n, 0]}
        if "D" in self.terms:
            number = dict(zip((slot.name for slot in self.slots), values, strict=True))
            Kd, Tf = number["Kd"], number["Tf"]
            slopes["Kd"] = (G[n, n] - G[n, n - 1]) / Tf
            into = G[n - 1, n] - G[n - 1, n - 1] + Kd * (G[n, n] - G[n, n - 1])
            slopes["Tf"] = -into / Tf**2
        return np.array([slopes[slot.name] for slot in self.slots])


def pid(
    measurement: str | None = None,
    control: str | None = None,
    kind: str = "PID",
    *,
    Kp: Given = None,
    Ki: Given = None,
    Kd: Given = None,
    Tf: Given = None,
    sign: int = 1,
    name: str | None = None,
) -> TunableBlock:
    r"""Return a PID controller to be tuned, or a part of one.

    .. math:: u = \mathrm{sign}\,\left(K_p + \frac{K_i}{s} + \frac{K_d\, s}{T_f\, s + 1}\right) y

    The sign of the loop is that of the whole package, u = K y: with ``sign=1`` a positive Kp pushes
    in the direction of y, and negative feedback has negative gains. With ``sign=-1`` they are those
    of the usual controller of an error r - y at r = 0, positive for negative feedback. Gains are
    free in sign unless limits say otherwise, so that either way the same loop is found.

    Parameters
    ----------
    measurement, control : str, optional
        What it reads and drives, by the plant's names; may be left out where there is only one.
    kind : {"PID", "PI", "PD", "P", "I", "D", "ID"}, optional
        Which terms; in small letters too.
    Kp, Ki, Kd : Tunable or float, optional
        Gains in units of u over y, per second for Ki, times seconds for Kd. A plain number is held;
        :func:`robustpolish.tunable` gives start and limits; without either it is tuned freely.
    Tf : Tunable or float, optional
        Time constant of the filter of the derivative, above 0, in s.
    sign : {1, -1}, optional
        -1 for the usual notation of negative feedback.
    name : str, optional
        By default ``pid_`` and the measurement.

    Returns
    -------
    TunableBlock
        For :func:`robustpolish.structured_output_feedback`.

    Raises
    ------
    InvalidInputError
        If a number does not make sense or belongs to a term that `kind` leaves out.

    Notes
    -----
    As MATLAB's ``tunablePID``, with ``sign=-1`` in a loop with negative feedback.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.pid("x", control="F", kind="PI", Kp=rp.tunable("Kp", 2.0, low=0.0), sign=-1)
    block: F = -(Kp + Ki/s) x
    """
    terms = one_of("kind", kind.upper() if isinstance(kind, str) else kind, KINDS)
    given = {"Kp": Kp, "Ki": Ki, "Kd": Kd, "Tf": Tf}
    wanted = [n for n in given if {"Kp": "P", "Ki": "I", "Kd": "D", "Tf": "D"}[n] in terms]
    for number, value in given.items():
        if value is not None and number not in wanted:
            shown = described(f"a number for a controller of kind {terms}")
            raise invalid(number, shown, "none", "Leave it out, or choose another kind.")
    slots = {
        "Kp": Slot("Kp", Kp, out=0, into=0),
        "Ki": Slot("Ki", Ki, time=-1, out=0, into=0, search="integral"),
        "Kd": Slot("Kd", Kd, time=1, out=0, into=0),
        "Tf": Slot("Tf", Tf, time=1, low=0.0, default=0.1, search="positive"),
    }
    stage = Pid(name=name, slots=tuple(checked_slot(slots[n]) for n in wanted), terms=terms)
    if all(slot.held == 0 for slot in stage.slots if slot.out is not None):
        shown = described("gains that are all held at 0")
        raise invalid("Kp", shown, "a gain that is tuned, or is not 0", "Leave one out.")
    return block_of(stage, measurement, control, sign)
