"""The force that is missing at one place, over the motion there."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, quantities
from robustpolish.plotting import plot_surface


@dataclass(frozen=True, eq=False, repr=False)
class ForceMap(Displayed):
    """The missing force over displacement and velocity at one place.

    Attributes
    ----------
    at : (str, str)
        Two coordinates, or one and ``"ground"``.
    surface : xarray.Dataset
        ``force`` on the first coordinate, the mean of each cell (NaN where the machine never was),
        and ``samples``, the share of the record in it, over ``displacement`` and ``velocity``.
    size : float
        Root mean square of the missing force here, in its unit.
    follows : float
        Share of its power that displacement and velocity foretell, from 0 to 1: what the map of
        one half of the record says of the other half. A law without memory at this place makes it
        1, noise and forces from elsewhere make it 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> found = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> found.maps[0].name, found.maps[0].plot().get_ylabel()
    ('x', 'velocity [mm/s]')
    >>> found.maps[0].describe().split(",")[-1]
    ' 0 % of their power follow from displacement and velocity.'
    """

    at: tuple[str, str]
    surface: xr.Dataset
    size: float
    follows: float

    @property
    def name(self) -> str:
        """The place in words: ``x``, or ``x - y``."""
        return self.at[0] if self.at[1] == "ground" else " - ".join(self.at)

    @property
    def unit(self) -> str:
        """Unit of the force."""
        return str(self.surface["force"].attrs.get("units", ""))

    def describe(self) -> str:
        """Say how much force is missing here and how far the motion here foretells it.

        Returns
        -------
        str
        """
        return (
            f"{self.name}: {self.size:.3g} {self.unit} (root mean square) are missing here, "
            f"{100 * self.follows:.0f} % of their power follow from displacement and velocity."
        )

    def _card(self) -> Card:
        rows = (
            (f"missing, root mean square [{self.unit}]", self.size),
            ("follows from the motion here", f"{100 * self.follows:.0f} %"),
            ("cells with samples", int((self.surface["samples"] > 0).sum())),
        )
        return Card(f"Missing force at {self.name}", (quantities(*rows),))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the map.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        ax = plot_surface(self.surface, ax)
        ax.set_title(f"missing force at {self.name}")
        return ax
