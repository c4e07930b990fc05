"""How a design fares over the machines that a fit leaves possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.stats import beta

from robustpolish.display import Card, Displayed, quantities
from robustpolish.plotting import plot_distribution


@dataclass(frozen=True, eq=False, repr=False)
class RobustnessCheck(Displayed):
    """A controller around many machines.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    nominal : float
        The norm of the design's certificate.
    norms : ndarray, shape (samples,)
        The norm of every loop; infinite if it is unstable.
    keys : tuple of str
        The numbers that were drawn, by the keys of ``model.parameters``.
    parameters : ndarray, shape (samples, keys)
        In SI units.
    nominal_parameters : ndarray, shape (keys,)
    left_out : tuple of str
        Numbers that were not drawn, because the data does not determine them.

    Examples
    --------
    >>> import numpy as np
    >>> import robustpolish as rp
    >>> check = rp.RobustnessCheck(
    ...     "hinf", 1.0, np.array([0.9, 1.2, np.inf]), ("dof.x.mass",),
    ...     np.array([[1.0], [1.1], [2.0]]), np.array([1.0]))
    >>> round(check.share_stable, 2), check.median, check.worst
    (0.67, 1.2, inf)
    >>> check.worst_parameters
    {'dof.x.mass': 2.0}
    >>> check.plot().get_ylabel()
    'number per bin (machine)'
    """

    norm: str
    nominal: float
    norms: NDArray[np.float64]
    keys: tuple[str, ...]
    parameters: NDArray[np.float64]
    nominal_parameters: NDArray[np.float64]
    left_out: tuple[str, ...] = ()

    @property
    def samples(self) -> int:
        """Number of machines."""
        return self.norms.size

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Which loops are stable, shape (samples,)."""
        return np.isfinite(self.norms)

    @property
    def share_stable(self) -> float:
        """Share of the loops that are stable."""
        return float(np.mean(self.stable))

    @property
    def least_share_stable(self) -> float:
        """Share of all such machines that are stable, at least, with 95 % confidence."""
        good = int(np.sum(self.stable))
        return float(beta.ppf(0.05, good, self.samples - good + 1)) if good else 0.0

    @property
    def median(self) -> float:
        """Median of the norms."""
        return float(np.quantile(self.norms, 0.5, method="nearest"))

    @property
    def worst(self) -> float:
        """Largest norm; infinite if a loop is unstable."""
        return float(np.max(self.norms))

    @property
    def worst_parameters(self) -> Mapping[str, float]:
        """The numbers of the worst machine."""
        row = self.parameters[int(np.argmax(self.norms))]
        return dict(zip(self.keys, row.tolist(), strict=True))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how the norms of the stable loops are distributed about the certificate's.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        name = {"hinf": "H-infinity norm", "h2": "H2 norm"}[self.norm]
        found = xr.DataArray(self.norms[self.stable], dims="machine", name=name)
        unstable = self.samples - found.size
        note = f"{unstable} of {self.samples} unstable" if unstable else ""
        return plot_distribution(found, {"certificate": self.nominal}, ax, note=note)

    def _card(self) -> Card:
        table = quantities(
            ("machines", self.samples),
            ("stable", f"{100 * self.share_stable:.4g} %"),
            ("stable, at least (95 %)", f"{100 * self.least_share_stable:.4g} %"),
            ("norm of the certificate", self.nominal),
            ("median norm", self.median),
            ("worst norm", self.worst),
        )
        left = f"Not drawn, because not determined: {', '.join(self.left_out)}."
        return Card("Robustness over the fit's errors", (table,), (left,) if self.left_out else ())
