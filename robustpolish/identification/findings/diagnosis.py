"""The result of a diagnosis."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.display import Card, Displayed, Table, estimate
from robustpolish.effects import LearnedLaw
from robustpolish.identification.findings.findings import Findings
from robustpolish.identification.findings.laws import laws_of
from robustpolish.identification.findings.machines import uncertain
from robustpolish.identification.findings.saved import content, findings_from
from robustpolish.identification.findings.words import explain, headline, plain, told_numbers
from robustpolish.plotting import plot_time_series
from robustpolish.saved_file import Fields, read_saved, write_saved


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Findings, Displayed):
    """What a model lacks.

    Attributes
    ----------
    verdict : str
        ``adequate``, ``parameters``, ``missing_effect``, ``partly_explained`` (what was found is
        there, and something else is missing), ``unknown_law`` (a force that no catalogue describes
        was learned, see `laws`) or ``unexplained``.
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
    notes : tuple of str
        Remarks of the record, and what looks wrong: numbers that moved by decades, signs, units,
        clipped peaks.
    maps : tuple of ForceMap
        Force that is still missing in the end over displacement and velocity, whatever the
        verdict; the place first where the motion foretells most of it.

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

    uncertain = uncertain

    @property
    def laws(self) -> tuple[LearnedLaw, ...]:
        """The learned laws of the model, each with its curve, its words and its picture."""
        return laws_of(self.model, self.covariance)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as the command line writes it.

        Returns
        -------
        dict
        """
        return plain(self)

    def explain(self) -> str:
        """Say in words what was found, why, and what to check on the machine.

        Returns
        -------
        str
        """
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
        write_saved(path, "diagnosis", content(self), force)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, max_bytes: float | None = None) -> Diagnosis:
        """Read a diagnosis from a file that :meth:`save` wrote.

        Parameters
        ----------
        path : path
        max_bytes : float, optional
            Largest size of the file in bytes, 2e8 by default.

        Returns
        -------
        Diagnosis

        Raises
        ------
        InvalidInputError
            If it is no such file; the message names the key that is wrong.
        """
        return diagnosis_from(read_saved(path, "diagnosis", max_bytes))

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
        found = [
            (effect.kind, ", ".join(effect.at), name, *estimate(v.value, v.stderr), v.unit)
            for effect in self.effects
            for name, v in told_numbers(effect).items()
        ]
        found += [
            (law.effect.kind, ", ".join(law.effect.at), f"largest {law.quantity}",
             float(abs(law.curve()[law.quantity]).max()), None, law.unit)
            for law in self.laws
        ]  # fmt: skip
        head = ("effect", "at", "parameter", "value", "standard error", "unit")
        tables = [Table("Added effects", head, tuple(found))] if found else []
        ledger = self.ledger._card()
        tables += [Table(ledger.title, t.columns, t.rows) for t in ledger.tables]
        return Card(headline(self), tuple(tables), (*self.reasons, *self.notes))


def diagnosis_from(fields: Fields) -> Diagnosis:
    """Return the diagnosis in a file.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, or names an effect that is not in the catalogue.
    """
    return Diagnosis(**vars(findings_from(fields)))
