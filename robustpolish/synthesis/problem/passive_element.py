"""A spring or a damper: what a passive feedback consists of."""

from __future__ import annotations

from dataclasses import dataclass

Place = tuple[str, str]


@dataclass(frozen=True)
class PassiveElement:
    """A spring or a damper between two places.

    Attributes
    ----------
    kind : {"spring", "damper"}
    between : (str, str)
        Names of two displacements, or of one and "ground".
    coefficient : float
        Stiffness in N/m or damping in N s/m (for rotations N m/rad and N m s/rad).
    unit : str
        "N/m" or "N s/m", or what follows from the units of the plant.

    Examples
    --------
    >>> import robustpolish as rp
    >>> print(rp.PassiveElement("spring", ("x", "ground"), 8e4, "N/m"))
    spring between x and ground: 80000 N/m
    """

    kind: str
    between: Place
    coefficient: float
    unit: str

    def __str__(self) -> str:
        places = " and ".join(self.between)
        return f"{self.kind} between {places}: {self.coefficient:.6g} {self.unit}"
