"""`cover`: a family of plants as one plant with dynamics of which only a bound is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.arrays import AnyArray, Vector
from robustpolish.display import Card, Displayed, quantities
from robustpolish.models.cover.bounding_weight import bounding_weight, envelope, raised
from robustpolish.models.cover.family import Family, Kind, errors, read_family, refined, response
from robustpolish.models.uncertain.parameters import uncertain_dynamics
from robustpolish.models.uncertain.system import UncertainSystem, as_uncertain
from robustpolish.plotting import plot_gains
from robustpolish.validation import described, invalid, is_whole, one_of

_KINDS = ("output", "input", "additive")
_MOST_ORDER = 12


@dataclass(frozen=True, eq=False, repr=False)
class Cover(Displayed):
    """A nominal plant and a weight that together stand for a family of plants.

    Attributes
    ----------
    nominal : control.StateSpace
        The plant in the middle.
    weight : control.StateSpace
        Stable, with a stable inverse; its gain is at least the error of every plant of the family
        at every one of `frequency`.
    kind : {"output", "input", "additive"}
        What the error is relative to.
    system : UncertainSystem
        The nominal plant with dynamics below the weight, for :func:`robust_stability` and others.
    frequency : ndarray, shape (n,)
        In rad/s.
    errors : ndarray, shape (plants, n)
        Largest gain of each plant's error.

    Examples
    --------
    >>> import numpy as np
    >>> import control
    >>> import robustpolish as rp
    >>> found = rp.cover([control.tf([k], [t, 1]) for k in (0.9, 1.1) for t in (0.2, 0.3)], order=2)
    >>> bool(found.covered), bool(found.tightness < 1.1)
    (True, True)
    >>> found.plot().get_ylabel()
    'relative error at the output'
    """

    nominal: control.StateSpace
    weight: control.StateSpace
    kind: Literal["output", "input", "additive"]
    system: UncertainSystem
    frequency: Vector
    errors: AnyArray

    @property
    def gains(self) -> Vector:
        """Gain of the weight at the frequencies."""
        return np.abs(response(self.weight, self.frequency)[:, 0, 0])

    @property
    def covered(self) -> bool:
        """Whether the weight lies above all errors at all frequencies."""
        return bool((self.gains >= self.errors.max(axis=0)).all())

    @property
    def tightness(self) -> float:
        """Largest ratio of the weight over the largest error whose narrow dips are filled."""
        return float(np.max(self.gains / envelope(self.frequency, self.errors.max(axis=0))))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the errors and the weight over frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        hertz = {"frequency": self.frequency / (2 * np.pi)}
        curves = {f"plant {i}": row for i, row in enumerate(self.errors, 1)}
        if len(curves) > 6:  # more than a legend holds
            curves = {"largest error": self.errors.max(axis=0)}
        labelled = {
            name: xr.DataArray(gain, hertz, "frequency")
            for name, gain in (curves | {"weight": self.gains}).items()
        }
        side = "error" if self.kind == "additive" else f"relative error at the {self.kind}"
        return plot_gains(labelled, ax=ax, name=side)

    def _card(self) -> Card:
        largest = self.errors.max(axis=0)
        rows = (
            ("plants", len(self.errors)),
            ("states of the weight", self.weight.nstates),
            ("smallest error covered", float(largest.min())),
            ("largest error covered", float(largest.max())),
            ("weight over error, at most", self.tightness),
        )
        low, high = self.frequency[[0, -1]] / (2 * np.pi)
        note = (
            f"Checked at {len(self.frequency)} frequencies from {low:.4g} to {high:.4g} Hz; "
            "nothing is known of the plants between and beyond them."
        )
        side = "an error" if self.kind == "additive" else f"a relative error at the {self.kind}"
        return Card(f"Cover by {side}", (quantities(*rows),), (note,))


def cover(
    plants: Any,
    nominal: Any = None,
    *,
    kind: Literal["output", "input", "additive"] = "output",
    order: int = 2,
    name: str = "cover",
) -> Cover:
    """Cover a family of plants by a nominal one with dynamics below a weight.

    Parameters
    ----------
    plants : sequence of control.LTI, control.FrequencyResponseData or xarray.DataArray
        Models, or responses measured at the same frequencies: as many of them as the machine shows
        faces. An array is what :func:`read_frequency_response` returns, of one measurement each.
    nominal : control.LTI, optional
        The plant in the middle. Of models by default the one whose largest error is smallest;
        measured responses need one.
    kind : {"output", "input", "additive"}, optional
        The form P = (I + W D) P0, P0 (I + W D) or P0 + W D with D any stable dynamics of gain at
        most 1. For several signals D is a full matrix, W the same for all of them: scale them.
    order : int, optional
        Largest number of states of the weight.
    name : str, optional
        Of the dynamics in the uncertain system.

    Returns
    -------
    Cover

    Raises
    ------
    InvalidInputError
        If the plants do not go together, or the form cannot make one of another: no relative error
        covers an output that the nominal plant cannot move, nor another number of unstable poles.

    Notes
    -----
    The weight is the one nearest to the largest error in decibels: the ratio is bounded by linear
    inequalities in the square of its gain, which is then factorised. Errors below 1e-4 of the
    largest and dips narrower than two octaves are not followed. Stability of a loop with the
    uncertain system is that of all plants whose error is below the weight and which have as many
    unstable poles as the nominal one [1]_; of measured ones that cannot be seen.

    References
    ----------
    .. [1] J. Doyle, G. Stein, "Multivariable feedback design: concepts for a classical/modern
       synthesis", IEEE Transactions on Automatic Control 26 (1981) 4-16.

    Examples
    --------
    A motor whose belt resonates somewhere between 20 and 30 rad/s:

    >>> import control
    >>> import robustpolish as rp
    >>> plants = [control.tf([w**2], [1, 0.2 * w, w**2, 0]) for w in (20, 22, 25, 28, 30)]
    >>> found = rp.cover(plants, plants[2], order=3)
    >>> found.covered, found.weight.nstates
    (True, 3)
    >>> margin = rp.robust_stability((found.system * 0.5).feedback())
    >>> bool(margin.robust)
    True
    """
    one_of("kind", kind, _KINDS)
    if not is_whole(order) or not 0 <= order <= _MOST_ORDER:
        raise invalid("order", order, f"a whole number from 0 to {_MOST_ORDER}", "Try 2.")
    family = read_family(plants, nominal)
    centre, found = _chosen(family, kind)
    largest = found.max(axis=0)
    if not largest.any():
        shown = described("plants that are all the same as the nominal one")
        raise invalid("plants", shown, "plants that differ", "There is nothing to cover.")
    weight = _weight(family, largest, int(order))
    if family.models:  # they are known between the frequencies of the fit, too
        family = refined(family)
        found = errors(family, response(centre, family.omega), kind)
        weight = _above(weight, family.omega, found.max(axis=0))
    return Cover(centre, weight, kind, _system(centre, weight, kind, name), family.omega, found)


def _chosen(family: Family, kind: Kind) -> tuple[control.StateSpace, AnyArray]:
    """Return the nominal plant and the errors of all plants from it."""
    if family.nominal is not None:
        return family.nominal, errors(family, response(family.nominal, family.omega), kind)
    tried: list[tuple[float, control.StateSpace, AnyArray]] = []
    for model, own in zip(family.models, family.responses, strict=True):
        found = errors(family, own, kind, refuse=False)
        tried.append((float(found.max()), model, found))
    size, model, found = min(tried, key=lambda item: item[0])
    if not np.isfinite(size):
        shown = described("plants none of which can be made of another")
        raise invalid("kind", shown, "a form that covers them", 'Try kind="additive".')
    return model, found


def _weight(family: Family, largest: Vector, order: int) -> control.StateSpace:
    """Return the weight, of sampled plants the bilinear image of a continuous one."""
    if not family.dt:
        return bounding_weight(family.omega, largest, order)
    step = 1.0 if family.dt is True else float(family.dt)
    found = bounding_weight(2 / step * np.tan(family.omega * step / 2), largest, order)
    image = control.sample_system(found, step, "bilinear")
    # The image has the same gains but for rounding, which is given back.
    return _above(image, family.omega, largest)


def _above(weight: control.StateSpace, omega: Vector, gains: Vector) -> control.StateSpace:
    """Return a weight raised to where it lies above gains at all frequencies."""
    short = float((gains / np.abs(response(weight, omega)[:, 0, 0])).max())
    return raised(weight, short) if short > 1 else weight


def _system(
    nominal: control.StateSpace, weight: control.StateSpace, kind: Kind, name: str
) -> UncertainSystem:
    """Return the nominal plant with dynamics below the weight."""
    ny, nu = nominal.noutputs, nominal.ninputs
    sizes = {"output": (ny, ny), "input": (nu, nu), "additive": (ny, nu)}
    delta = uncertain_dynamics(name, sizes[kind]).matrices
    error = as_uncertain("weight", weight) * UncertainSystem(replace(delta, dt=nominal.dt or 0))
    centre = as_uncertain("nominal", nominal)
    if kind == "additive":
        system = centre + error
    elif kind == "input":
        system = centre * (np.eye(nu) + error)
    else:
        system = (np.eye(ny) + error) * centre
    return UncertainSystem(system.matrices.names(nominal.input_labels, nominal.output_labels))
