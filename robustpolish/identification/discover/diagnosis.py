"""The result of a diagnosis."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.display import Card, Displayed, Table
from robustpolish.effects import Effect
from robustpolish.identification.discover.ledger import Ledger
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.plotting import plot_time_series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Value:
    """A fitted number with its standard error and unit."""

    value: float
    stderr: float
    unit: str


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added, with fitted parameters."""

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class RankedCandidate:
    """An effect that was tried.

    Attributes
    ----------
    step : int
        1 when it was tried as the first effect, and so on.
    nrmse_held_out : float
        Error on held-out blocks over the deviation, the mean over the outputs.
    score : float
        Log odds from screening.
    remark : str
        Why it was not taken, if there is a reason.
    """

    kind: str
    at: tuple[str, ...]
    nrmse_held_out: float
    score: float
    step: int
    parameters: Mapping[str, float]
    remark: str = ""


@dataclass(frozen=True)
class Confusion:
    """Two effects that this data cannot tell apart, and an experiment that would."""

    first: Effect
    second: Effect
    experiment: str


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Displayed):
    """What a model lacks.

    Attributes
    ----------
    verdict : str
        ``adequate``, ``parameters``, ``missing_effect`` or ``unexplained``.
    model : MechanicalModel
        The refitted model with the effects that were found.
    effects : tuple of FoundEffect
        In the order in which they were added.
    candidates : tuple of RankedCandidate
        Those of the first step first, the best first.
    indistinguishable : tuple of Confusion
    ledger : Ledger
    missing_force : ndarray, shape (sites, samples)
        Force that is still missing in the end, at each of `sites`.
    sites : tuple of tuple of str
    parameters : mapping
        All fitted numbers of the model.
    covariance : xarray.DataArray or None
        Covariance of these numbers, over their keys twice, in SI units.
    reasons : tuple of str
        Why this verdict.
    reproducible : bool
        Whether free runs of the model judge anything.
    time : ndarray, shape (samples,)
        When `missing_force` acts, in s.

    Examples
    --------
    >>> import os, tempfile
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> diagnosis = rp.diagnose(model, data.isel(time=slice(0, 500)))
    >>> print(diagnosis.explain().splitlines()[0])
    The model lacked: Coulomb friction at x, ground.
    >>> diagnosis.to_dict()["effects"][0]["kind"]
    'coulomb_friction'
    >>> diagnosis.plot().get_ylabel(), diagnosis.plot_missing_force().get_xlabel()
    ('relative error of x', 'time [ms]')
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     diagnosis.save(os.path.join(folder, "slide.json"))
    ...     again = rp.Diagnosis.load(os.path.join(folder, "slide.json"))
    >>> again.effects == diagnosis.effects
    True
    """

    verdict: str
    model: MechanicalModel
    effects: tuple[FoundEffect, ...]
    candidates: tuple[RankedCandidate, ...]
    indistinguishable: tuple[Confusion, ...]
    ledger: Ledger
    missing_force: Array
    sites: tuple[tuple[str, ...], ...]
    parameters: Mapping[str, Value] = field(default_factory=dict)
    covariance: xr.DataArray | None = None
    reasons: tuple[str, ...] = ()
    reproducible: bool = True
    time: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def noise_floor(self) -> Mapping[str, float]:
        """Noise over each output's standard deviation."""
        return self.ledger.noise_floor

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as the command line writes it.

        Returns
        -------
        dict
        """
        return {
            "verdict": self.verdict,
            "effects": [
                {
                    "kind": e.kind,
                    "at": list(e.at),
                    "parameters": {k: _plain(v) for k, v in e.parameters.items()},
                }
                for e in self.effects
            ],
            "candidates": [
                {
                    "kind": c.kind,
                    "at": list(c.at),
                    "nrmse_held_out": _number(c.nrmse_held_out),
                    "step": c.step,
                    "score": _number(c.score),
                    "remark": c.remark,
                }
                for c in self.candidates
            ],
            "indistinguishable": [
                [_place(c.first), _place(c.second)] for c in self.indistinguishable
            ],
            "experiments": [c.experiment for c in self.indistinguishable],
            "ledger": [
                {"step": e.step, "nrmse": {k: _number(v) for k, v in e.nrmse.items()}}
                for e in self.ledger.entries
            ],
            "noise_floor": {k: _number(v) for k, v in self.noise_floor.items()},
            "parameters": {k: _plain(v) for k, v in self.parameters.items()},
            "reasons": list(self.reasons),
            "free_run_reproducible": self.reproducible,
        }

    def explain(self) -> str:
        """Say in words what was found, why, and what to check on the machine.

        Returns
        -------
        str
        """
        from robustpolish.identification.discover.explain import explain

        return explain(self)

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the diagnosis, its model included, to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.
        """
        from robustpolish.identification.discover.diagnosis_file import save_diagnosis

        save_diagnosis(self, path, force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Diagnosis:
        """Read a diagnosis from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        Diagnosis

        Raises
        ------
        InvalidInputError
            If it is no such file; the message names the key that is wrong.
        """
        from robustpolish.identification.discover.diagnosis_file import load_diagnosis

        return load_diagnosis(path)

    def plot(self, ax: Axes | None = None, *, output: str | None = None) -> Axes:
        """Draw how the error of one output fell, as :meth:`Ledger.plot`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.
        output : str, optional
            The first by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        return self.ledger.plot(ax, output=output)

    def plot_missing_force(self, ax: Axes | None = None) -> Axes:
        """Draw the force that is still missing in the end, at every site.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        time = self.time if self.time.size else np.arange(float(self.missing_force.shape[1]))
        turning = {dof.name for dof in self.model.dofs if dof.rotational}
        signals = {
            " - ".join(site): xr.DataArray(
                force,
                {"time": time},
                "time",
                "missing force",
                {"units": "N m" if site[0] in turning else "N"},
            )
            for site, force in zip(self.sites, self.missing_force, strict=True)
        }
        return plot_time_series(signals, ax)

    def _card(self) -> Card:
        from robustpolish.identification.discover.explain import headline

        found = [
            (effect.kind, ", ".join(effect.at), name, v.value, v.stderr, v.unit)
            for effect in self.effects
            for name, v in effect.parameters.items()
        ]
        head = ("effect", "at", "parameter", "value", "standard error", "unit")
        tables = [Table("Added effects", head, tuple(found))] if found else []
        ledger = self.ledger._card()
        tables += [Table(ledger.title, t.columns, t.rows) for t in ledger.tables]
        return Card(headline(self), tuple(tables), self.reasons)


def _plain(value: Value) -> dict[str, Any]:
    return {"value": _number(value.value), "stderr": _number(value.stderr), "unit": value.unit}


def _number(value: float) -> float | None:
    """JSON has no infinity: what is not known is null."""
    return float(value) if np.isfinite(value) else None


def _place(effect: Effect) -> dict[str, Any]:
    return {"kind": effect.kind, "at": list(effect.at)}
