"""How a design fares over the machines that a fit leaves possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from robustpolish.display import Card, Displayed, quantities
from robustpolish.plotting import plot_distribution
from robustpolish.sweeps.confidence import share_at_least
from robustpolish.validation import invalid


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
    unit : str
        Of the norms, where all signals have one each.

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
    unit: str = ""

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
        return share_at_least(int(np.sum(self.stable)), self.samples, 0.95)

    @property
    def most_share_stable(self) -> float:
        """Share of all such machines that are stable, at most, with 95 % confidence."""
        return 1.0 - share_at_least(int(np.sum(~self.stable)), self.samples, 0.95)

    def least_share_within(self, norm: float, confidence: float = 0.95) -> float:
        """Return the share of all such machines whose norm is at most `norm`, at least.

        Parameters
        ----------
        norm : float
            Chosen before looking at the result; :attr:`worst` is the largest of a sample, of which
            the same is true.
        confidence : float, optional

        Returns
        -------
        float
            The lower limit of Clopper and Pearson, for independent draws.

        Examples
        --------
        >>> import numpy as np
        >>> import robustpolish as rp
        >>> check = rp.RobustnessCheck(
        ...     "hinf", 1.0, np.linspace(0.9, 1.1, 59), ("dof.x.mass",),
        ...     np.linspace(0.9, 1.1, 59)[:, None], np.array([1.0]))
        >>> round(check.least_share_within(check.worst), 3), round(check.least_share_within(1.0), 2)
        (0.95, 0.39)
        """
        if not 0 < confidence < 1:
            raise invalid("confidence", confidence, "a share between 0 and 1", "Write 0.95.")
        within = self.stable & (self.norms <= norm)
        return share_at_least(int(np.sum(within)), self.samples, confidence)

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
        found = xr.DataArray(
            self.norms[self.stable], dims="machine", name=name, attrs={"units": self.unit}
        )
        unstable = self.samples - found.size
        note = f"{unstable} of {self.samples} unstable" if unstable else ""
        return plot_distribution(found, {"certificate": self.nominal}, ax, note=note)

    def _card(self) -> Card:
        # Where a loop is unstable, the share of stable ones says it already.
        within = f"{100 * self.least_share_within(self.worst):.4g} %"
        no_worse = (("no worse, at least (95 %)", within),) if np.isfinite(self.worst) else ()
        table = quantities(
            ("machines", self.samples),
            ("stable", f"{100 * self.share_stable:.4g} %"),
            ("stable, at least (95 %)", f"{100 * self.least_share_stable:.4g} %"),
            ("stable, at most (95 %)", f"{100 * self.most_share_stable:.4g} %"),
            ("norm of the certificate", self.nominal),
            ("median norm", self.median),
            ("worst norm", self.worst),
            *no_worse,
        )
        left = f"Not drawn, because not determined: {', '.join(self.left_out)}."
        return Card("Robustness over the fit's errors", (table,), (left,) if self.left_out else ())
