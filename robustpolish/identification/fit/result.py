"""Result of a parameter estimation: values, standard errors, and the machines that it allows."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import lmfit
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.special import chdtri

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import described, instance_of, invalid, misfit, positive
from robustpolish.base.results import Card, Displayed, Table, estimate
from robustpolish.errors import RobustPolishWarning
from robustpolish.identification.fit.parameters import FreeParameter
from robustpolish.identification.free_runs import RecordError, records_content, records_table
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import SignalSlope
from robustpolish.machines.mechanical.data import context_values, unit_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Input, Output
from robustpolish.plants.uncertain.build import Ellipsoid, uncertain_ellipsoid, uncertain_real
from robustpolish.plants.uncertain.lft import real_number
from robustpolish.plants.uncertain.system import UncertainSystem, as_uncertain
from robustpolish.plots.charts import plot_bars

# The machines that a fit allows: its covariance as an ellipsoid of an uncertain system.

NAME = "fit"
"""Of the ellipsoid of a fit."""

# What the ports of an effect are called in a model.
_FORCE, _DISPLACEMENT = " (force)", " (displacement)"


class Fitted:
    """A model that was fitted to data, and the machines that these allow."""

    model: MechanicalModel
    covariance: Any

    def uncertain(
        self,
        confidence: float = 0.95,
        *,
        ranges: Mapping[str, Any] | None = None,
        ports: Sequence[str] = (),
    ) -> UncertainSystem:
        """Return the machines that the data allow: the linear part, its numbers in an ellipsoid.

        Parameters
        ----------
        confidence : float, optional
            Probability that the true numbers lie in the ellipsoid, all of them together.
        ranges : mapping of str to float, (float, float) or UncertainSystem, optional
            Numbers of which something else is to be said, as :meth:`MechanicalModel.uncertain`
            takes them: those that the data leave open, and others that were not fitted.
        ports : sequence of str, optional
            Effects such as ``"effect[0]"`` whose places get an input for the force and an output
            for the displacement, each of that name, for :func:`robust_sector`.

        Returns
        -------
        UncertainSystem
            With the inputs and outputs of the model. A witness is told in physical numbers by
            :meth:`UncertainSystem.numbers`. Gains of inputs and sensors that were found as effects
            are in it. A warning names the forces of effects and the delays, which are not.

        Raises
        ------
        InvalidInputError
            If the data leave a number open, or a mass that may be 0.

        Notes
        -----
        The ellipsoid is that of a normal distribution with the covariance of the fit, for as many
        numbers as there are, after the priors: standard errors of it account for residuals that are
        coloured, not for a model that is wrong in kind. It may reach past what is physical, to a
        negative damping, which proves more than is needed. Masses that gave forces their unit, and
        whatever else was not fitted, are certain.

        Examples
        --------
        >>> import warnings
        >>> import robustpolish as rp
        >>> model, data = rp.datasets.sticky_slide()
        >>> model = model.with_effect("coulomb_friction", ("x", "ground"))
        >>> fitted = rp.refit(model, data.isel(time=slice(0, 500)))
        >>> with warnings.catch_warnings(action="ignore"):  # the friction is no part of it
        ...     machines = fitted.uncertain()
        >>> sorted({element.group for element in machines.elements.values()})
        ['fit']
        """
        model, covariance = self.model, self.covariance
        remedy = 'Write {"key": 0.1}.'
        said = dict(instance_of("ranges", ranges or {}, Mapping, "a mapping", remedy))
        gains = _gains(model)
        keys = [] if covariance is None else covariance["parameter"].values.tolist()
        linear = [key for key in keys if key in gains or not key.startswith("effect[")]
        kept = [key for key in linear if key not in said]
        known: Mapping[str, UncertainSystem] = {}
        if covariance is not None and kept:
            places = [keys.index(key) for key in kept]
            known = _ellipsoid(model, kept, covariance.values[np.ix_(places, places)], confidence)
        model = _with_ports(model, ports)
        _warn_of_omitted_effects(model, {*gains, *(f"{name}.gain" for name in ports)})
        numbers = {key: number for key, number in {**known, **said}.items() if key not in gains}
        system, factors = model.uncertain(numbers), {}
        for key in gains:
            nominal = model.parameters[key]
            told = key in said
            factors[key] = _factor(key, nominal, said[key]) if told else known.get(key, nominal)
        system = _with_gains(model, system, gains, factors) if gains else system
        # A model keeps names of inputs and outputs apart, a system need not.
        ends = {name + end: name for name in ports for end in (_FORCE, _DISPLACEMENT)}
        inputs = [ends.get(name, name) for name in system.input_labels]
        outputs = [ends.get(name, name) for name in system.output_labels]
        return UncertainSystem(system.matrices.names(inputs, outputs))


def _ellipsoid(
    model: MechanicalModel, keys: list[str], covariance: np.ndarray, confidence: float
) -> Ellipsoid:
    """Return the ellipsoid of some numbers, if the data tell all of them."""
    values = model.parameters
    unknown = [k for k, v in zip(keys, np.diagonal(covariance), strict=True) if not np.isfinite(v)]
    remedy = "Say in ranges what is known of it, or record what moves it."
    if unknown:
        shown = described(f"{', '.join(unknown)}, which the data do not see")
        raise invalid("ranges", shown, "a range of each", remedy)
    centre = {key: values[key] for key in keys}
    found = uncertain_ellipsoid(centre, covariance=covariance, confidence=confidence, name=NAME)
    for key, (low, high) in found.ranges.items():
        if key.startswith("dof.") and low <= 0:
            shown = described(f"{key} from {low:.4g} to {high:.4g}")
            raise invalid("ranges", shown, "masses and inertias above 0", remedy)
    return found


def _gains(model: MechanicalModel) -> dict[str, Effect]:
    """Return the effects that are factors of an input or an output, by the keys of their gains."""
    return {
        f"effect[{i}].gain": effect
        for i, effect in enumerate(model.effects)
        if effect.definition.acts_on_signals and [*effect.values] == ["gain"]
    }


def _factor(key: str, nominal: float, given: Any) -> UncertainSystem:
    """Return a gain of which a share, a range or an uncertain number was given."""
    if isinstance(given, UncertainSystem):
        return given
    if isinstance(given, tuple | list):
        return uncertain_real(key, nominal, range=given)  # type: ignore
    return uncertain_real(key, nominal, percent=100 * real_number(key, given))


def _with_gains(
    model: MechanicalModel,
    system: UncertainSystem,
    gains: Mapping[str, Effect],
    factors: Mapping[str, Any],
) -> UncertainSystem:
    """Put the factors of effects on the inputs and outputs of a system."""
    m = model.matrices
    before, after = (np.eye(len(names)).astype(object) for names in (m.signals, m.outputs))
    for key, effect in gains.items():
        on_input = effect.definition.domain == "input"
        diagonal, names = (before, m.sources) if on_input else (after, m.outputs)
        for i, name in enumerate(names):
            if name == effect.at[0]:
                diagonal[i, i] = diagonal[i, i] * factors[key]
    found = as_uncertain("after", after) * system * as_uncertain("before", before)
    return UncertainSystem(found.matrices.names(system.input_labels, system.output_labels))


def _with_ports(model: MechanicalModel, ports: Sequence[str]) -> MechanicalModel:
    """Give the places of some effects an input and an output."""
    places = {}
    for name in ports:
        first, second, *_ = (*port_effect(model, name).at, "ground")
        places[name] = (first, second)
    return replace(
        model,
        inputs=(*model.inputs, *(Input(n + _FORCE, at) for n, at in places.items())),
        outputs=(*model.outputs, *(Output(n + _DISPLACEMENT, at) for n, at in places.items())),
    )


def port_effect(model: MechanicalModel, key: str) -> Effect:
    """Return the effect of a key such as "effect[0]", if it is a force between two ends."""
    known = {
        f"effect[{i}]": effect
        for i, effect in enumerate(model.effects)
        if effect.definition.domain in ("pair", "dof")
    }
    if key not in known:
        listed = ", ".join(known) or "there is none"
        expected = f"a force between two places: {listed}"
        raise invalid("ports", key, expected, "Count effects from 0.")
    return known[key]


def _warn_of_omitted_effects(model: MechanicalModel, kept: Collection[str]) -> None:
    """Warn of effects that the uncertain machine lacks, and that act back on the motion."""
    missing = [
        effect
        for i, effect in enumerate(model.effects)
        if f"effect[{i}].gain" not in kept and _depends_on_motion(effect)
    ]
    if missing:
        warnings.warn(
            f"Left out of the uncertain machine: {', '.join(map(str, missing))}. What is proven "
            "of it holds for the linear part: judge the rest by rp.simulate(model, controller, "
            "load).",
            RobustPolishWarning,
            stacklevel=3,
        )


def _depends_on_motion(effect: Effect) -> bool:
    """Say whether an effect does something that no force or offset from outside could be."""
    kind = effect.definition
    if kind.acts_on_signals:
        return kind.signal_slope(effect.values) != SignalSlope() or kind.timing is not None
    return kind.sharp or kind.has_memory or kind.steepness(effect.values, 1.0, 1.0)[:2] != (0, 0)


# The result of a fit.

# Standard error over the value from which a number is called undetermined.
_UNDETERMINED = 1 / 3


@dataclass(frozen=True, eq=False, repr=False)
class Refit(Fitted, Displayed):
    """A model with fitted parameters.

    Attributes
    ----------
    model : MechanicalModel
    parameters : lmfit.Parameters
        Values, bounds and standard errors; "." and brackets in names are underscores.
    units : dict
        Unit of each parameter.
    nrmse : dict
        Error of a free run over each output's standard deviation; of a fit to frequency
        responses the relative error of each pair.
    undetermined : tuple of str
        Keys that the data leaves undetermined (a standard error above a third of the value).
    stderr : mapping of str to float
        Standard error by key of `units`.
    covariance : xarray.DataArray
        Covariance of the parameters, over their keys twice, in SI units.
    notes : tuple of str
        Remarks of the record, and what looks wrong: numbers that moved by decades, signs, units,
        clipped peaks.
    records : dict of str to RecordError
        The errors of each record by its name, of a free run as :func:`robustpolish.compare` has
        it; none of frequency responses.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> fitted = rp.refit(model.with_effect("coulomb_friction", ("x", "ground")), data)
    >>> round(fitted.model.parameters["effect[0].force"], 1), fitted.undetermined
    (3.0, ())
    >>> sorted(fitted.to_dict()["parameters"]["effect[0].force"])
    ['determined', 'stderr', 'unit', 'value']
    >>> fitted.plot().get_xlabel()
    'relative standard error [%]'
    """

    model: MechanicalModel
    parameters: lmfit.Parameters
    units: dict[str, str]
    nrmse: dict[str, float]
    undetermined: tuple[str, ...]
    stderr: Mapping[str, float]
    covariance: xr.DataArray
    notes: tuple[str, ...] = ()
    records: Mapping[str, RecordError] = field(default_factory=dict)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the standard error of every parameter relative to its value.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        values, errors = self.model.parameters, self.stderr
        labels = {"parameter": [f"{k} = {values[k]:.4g} {self.units[k]}" for k in errors]}
        relative = [100 * e / abs(values[k]) if values[k] else np.inf for k, e in errors.items()]
        name, attributes = "relative standard error", {"units": "%"}
        bars = xr.DataArray(relative, labels, "parameter", name, attributes)
        left_open = xr.DataArray([k in self.undetermined for k in errors], labels, "parameter")
        meaning = ("determined", "left open by the data")
        return plot_bars(bars, left_open, ax, meaning=meaning)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as in the JSON of ``robustpolish refit``.

        Returns
        -------
        dict
        """
        values = self.model.parameters
        return {
            "parameters": {
                key: {
                    "value": values[key],
                    "stderr": error,
                    "unit": self.units[key],
                    "determined": key not in self.undetermined,
                }
                for key, error in self.stderr.items()
            },
            "nrmse": dict(self.nrmse),
            "records": records_content(self.records),
        }

    def _card(self) -> Card:
        values = self.model.parameters
        rows = tuple(
            (key, *estimate(values[key], error), self.units[key], key not in self.undetermined)
            for key, error in self.stderr.items()
        )
        columns = ("parameter", "value", "standard error", "unit", "determined")
        errors = tuple(self.nrmse.items())
        tables = (Table("", columns, rows), Table("", ("output", "NRMSE"), errors))
        return Card("Refit", (*tables, *records_table(self.records)), self.notes)


def refit_of(
    model: MechanicalModel,
    free: Sequence[FreeParameter],
    covariance: xr.DataArray,
    nrmse: dict[str, float],
) -> Refit:
    """Return values, bounds and standard errors of a fit.

    Parameters
    ----------
    model : MechanicalModel
        Fitted.
    free : sequence of FreeParameter
    covariance : xarray.DataArray
        Over their keys twice.
    nrmse : dict of str to float
        Relative errors.
    """
    errors, values = stderr_from_covariance(covariance), model.parameters
    parameters = lmfit.Parameters()
    for f in free:
        # lmfit takes identifiers only
        name = "".join(c if c.isalnum() else "_" for c in f.key).strip("_")
        parameters.add(name, value=values[f.key], min=f.lower, max=f.upper)
        parameters[name].stderr = errors[f.key]
    units = {f.key: unit_of(model, f.key) for f in free}
    # not a number is left open, too
    left_open = (k for k in units if not errors[k] <= _UNDETERMINED * abs(values[k]) < np.inf)
    return Refit(model, parameters, units, nrmse, tuple(left_open), errors, covariance)


def stderr_from_covariance(covariance: xr.DataArray) -> dict[str, float]:
    """Return the standard errors that belong to a covariance."""
    errors = np.sqrt(np.maximum(np.diag(covariance.values), 0.0))
    return dict(zip(covariance["parameter"].values.tolist(), errors.tolist(), strict=True))


# The sector of a force that was found: between which slopes it lies up to an amplitude.

# Displacements at which a law is looked at, on either side.
_POINTS = 1000
# Velocities in m/s or rad/s, and times in s, at which a law is asked for other dependences.
_VELOCITIES, _TIMES = (0.0, 1.0, -1.0), (0.0, 0.3)


def effect_sector(
    learned: Any, effect: str, amplitude: float, confidence: float = 0.95
) -> tuple[float, float]:
    r"""Return the slopes between which the force of an effect lies up to an amplitude.

    Parameters
    ----------
    learned : Diagnosis, Refit or MechanicalModel
        What a fit found, with the covariance of its numbers; those of a model are certain.
    effect : str
        Such as ``"effect[0]"``, by its place in ``model.effects``: a force that depends on the
        displacement of its place alone.
    amplitude : float
        Largest displacement, in m or rad.
    confidence : float, optional
        Probability that each of the effect's numbers lies in the interval that is allowed for.

    Returns
    -------
    low, high : float
        In N/m or N m/rad: ``low q^2 <= -f(q) q <= high q^2`` for \|q\| up to the amplitude, for
        :func:`robust_sector`.

    Raises
    ------
    InvalidInputError
        If the force depends on more than the displacement, does not vanish with it, or is not
        linear in a number that the data leave uncertain.

    Notes
    -----
    The law is looked at at a thousand displacements on either side, at both ends of each number.
    The numbers of the machine in their ellipsoid and those of the effect in their intervals are all
    true together with a probability of at least one less the sum of what each lacks.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, _ = rp.datasets.sticky_slide()
    >>> model = model.with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 2e6})
    >>> low, high = rp.uncertain.effect_sector(model, "effect[0]", 0.01)
    >>> round(low), round(high)
    (0, 200)
    """
    model = learned if isinstance(learned, MechanicalModel) else getattr(learned, "model", None)
    remedy = "Pass one of these."
    model = instance_of("learned", model, MechanicalModel, "a diagnosis, refit or model", remedy)
    found = port_effect(model, effect)
    size = positive("amplitude", amplitude)
    if not 0 < confidence < 1:
        raise invalid("confidence", confidence, "a share between 0 and 1", "Write 0.95.")
    spread = _spread(getattr(learned, "covariance", None), effect, confidence)
    linear = {name for item in found.definition.linear_in
              for name in ((item,) if isinstance(item, str) else item)}  # fmt: skip
    bent = [name for name, half in spread.items() if half > 0 and name not in linear]
    if bent:
        shown = described(f"{found}, whose force is not linear in {', '.join(bent)}")
        raise invalid("effect", shown, "a force that is linear in its numbers", "Bound it by hand.")
    q = size * np.concatenate(
        [np.linspace(-1, 0, _POINTS, False), np.linspace(1, 0, _POINTS, False)]
    )
    slopes = []
    for signs in itertools.product((-1.0, 1.0), repeat=len(spread)):
        moved = {
            n: found.values[n] + s * h for s, (n, h) in zip(signs, spread.items(), strict=True)
        }
        slopes.append(_slopes(model, found.with_values(found.values | moved), q))
    every = np.concatenate(slopes)
    return float(every.min()), float(every.max())


def _spread(covariance: Any, key: str, confidence: float) -> dict[str, float]:
    """Return the half widths of the intervals of an effect's numbers."""
    if covariance is None:
        return {}
    half = float(np.sqrt(chdtri(1, 1 - confidence)))
    found = {}
    for i, name in enumerate(covariance["parameter"].values.tolist()):
        if name.startswith(f"{key}."):
            found[name.removeprefix(f"{key}.")] = half * float(np.sqrt(covariance.values[i, i]))
    if not all(np.isfinite(value) for value in found.values()):
        shown = described(f"{key}, whose numbers the data do not see")
        raise invalid("effect", shown, "a force that was measured", "Record what moves it.")
    return found


def _slopes(model: MechanicalModel, effect: Effect, q: Vector) -> Vector:
    """Return minus the force over the displacement."""
    kind = effect.definition
    law = kind.law
    if law is None or kind.ports != 1 or kind.has_memory:
        raise misfit("effect", str(effect), "a force of one displacement", "Bound it by hand.")
    p = np.array([*effect.values.values(), *context_values(model, effect, 0.0)])

    def force(x: float, v: float, t: float) -> float:
        f = np.zeros(1)
        law(t, np.array([x]), np.array([v]), np.zeros(0), p, f, np.zeros(0))
        return float(f[0])

    values = np.array([force(x, 0.0, 0.0) for x in q.tolist()])
    size = np.abs(values).max()
    others = [
        abs(force(x, v, t) - force(x, 0.0, 0.0))
        for x in (q[0], 0.0) for v in _VELOCITIES for t in _TIMES
    ]  # fmt: skip
    if max(others) > 1e-12 * size or abs(force(0.0, 0.0, 0.0)) > 1e-12 * size:
        shown = described(f"{effect}, which depends on more than the displacement")
        raise invalid("effect", shown, "a force of the displacement alone", "Bound it by hand.")
    return -values / q
