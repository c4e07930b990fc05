"""Find the experiment that tells two machines apart that a record does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.experiments.candidates import experiments
from robustpolish.identification.experiments.distance import (
    Machines,
    UnusableError,
    distance,
)
from robustpolish.identification.experiments.machines import (
    apart_in_words,
    machines_of,
    numbers_of,
)
from robustpolish.identification.experiments.policy import EXPERIMENTS, ExperimentPolicy
from robustpolish.identification.experiments.told import ToldApart, TriedExperiment
from robustpolish.identification.findings.diagnosis import Diagnosis
from robustpolish.identification.findings.findings import Confusion
from robustpolish.identification.findings.refitted import Refit
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.numbers.refit import refit
from robustpolish.identification.observer.kalman import excited_bandwidth, scales_of
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import Record, long_enough, over_time, record_of
from robustpolish.long_calls import working
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid, positive


def tell_apart(
    machines: Diagnosis | tuple[MechanicalModel, MechanicalModel],
    data: Any,
    *,
    pair: int = 0,
    noise: Mapping[str, float] | None = None,
    limits: Mapping[str, float] | None = None,
    fit: bool = True,
    progress: Callable[[str], None] | None = None,
    _policy: ExperimentPolicy = EXPERIMENTS,
) -> ToldApart:
    """Search for the experiment that tells two machines apart which a record does not.

    Experiments are simulated on both: the record's own excitation, steps, slow motions to and
    fro, sweeps and free decays, at 0.3 to 10 times the amplitudes of the record.

    Parameters
    ----------
    machines : Diagnosis or (MechanicalModel, MechanicalModel)
        A diagnosis with effects that its data cannot tell apart, or two models with the same
        coordinates, inputs and outputs.
    data : xarray.Dataset, path or pandas.DataFrame
        The record that does not tell: it says how large inputs and motions are.
    pair : int, optional
        Which of the diagnosis's pairs, `Diagnosis.indistinguishable`.
    noise : mapping of str to float, optional
        Standard deviation of the noise of outputs, in SI units. By default the noise floor of the
        diagnosis, or what the quietest band of the record allows for.
    limits : mapping of str to float, optional
        Largest value that an input or an output may take, in SI units.
    fit : bool, optional
        Whether both machines are fitted to the record first (the first one of a diagnosis is
        already). Without, nothing says how far numbers may move.
    progress : callable, optional
        Called with a short text at every step.

    Returns
    -------
    ToldApart
        With the experiment that is recommended, or none.

    Raises
    ------
    InvalidInputError
        If there is no such pair, the models differ in what they consist of, `data` do not suit
        them, or `noise` or `limits` name what they do not have.

    Notes
    -----
    Two machines are told apart where the difference is large after the numbers of the second
    took after the first: Gauss-Newton steps minimise the sum of squares over the noise, and
    leaving the numbers that the record gave costs what its covariance says. This is the design
    of experiments that tell models apart (W. G. Hunter and A. M. Reiner 1965, Technometrics 7,
    307-323), with refitted rivals.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> place = ("x", "ground")
    >>> pair = (
    ...     model.with_effect("coulomb_friction", place, {"force": 3.0}),
    ...     model.with_effect("quadratic_damping", place, {"coefficient": 40.0}),
    ... )
    >>> told = rp.tell_apart(pair, data.isel(time=slice(0, 500)))
    >>> told.recommended.experiment.kind in ("record", "step", "to and fro", "sweep", "decay")
    True
    >>> told.recommended.left > 3
    True
    """
    if progress is not None:
        return _tell_apart(machines, data, pair, noise, limits, fit, progress, _policy)
    with working("Trying experiments") as tell:
        return _tell_apart(machines, data, pair, noise, limits, fit, tell, _policy)


def _tell_apart(
    machines: Diagnosis | tuple[MechanicalModel, MechanicalModel],
    data: Any,
    number: int,
    noise: Mapping[str, float] | None,
    limits: Mapping[str, float] | None,
    fit: bool,
    say: Callable[[str], None],
    policy: ExperimentPolicy,
) -> ToldApart:
    over_time(data)
    diagnosis = machines if isinstance(machines, Diagnosis) else None
    hint = ""
    if diagnosis is not None:
        chosen = _pair_of(diagnosis, number)
        hint = chosen.experiment
        models = machines_of(diagnosis.model, chosen)
    else:
        models = _alike(machines)
    record = long_enough(models[0], record_of(models[0], data))
    floor = _noise(models[0], record, noise, diagnosis)
    reach = _reach(models[0], record, limits, policy)
    names = apart_in_words(*models)
    on_record: dict[str, tuple[float, float]] = {}
    if fit:
        fits = [_fitted(m, record, diagnosis, i, say) for i, m in enumerate(models)]
        models = fits[0][0], fits[1][0]
        on_record = {k: (fits[0][1][k], fits[1][1][k]) for k in models[0].output_names}
        known, precision = fits[1][2]
    else:
        known, precision = _unknown(models[1], record)
    both = Machines(*models, names, floor, known, precision)
    places = [end for model in models for e in model.effects for end in e.at]
    tried, refused = [], []
    wanted = experiments(models[0], record, places, limits, policy)
    say(f"simulating {len(wanted)} experiments")
    for experiment in wanted:
        try:
            tried.append(
                TriedExperiment(experiment, distance(both, experiment, reach, policy), floor)
            )
        except UnusableError as why:
            refused.append((str(experiment), str(why)))
    tried.sort(key=lambda t: -t.left)
    return ToldApart(both, tuple(tried), tuple(refused), on_record, hint)


def _pair_of(diagnosis: Diagnosis, number: int) -> Confusion:
    pairs = diagnosis.indistinguishable
    if not 0 <= number < len(pairs):
        listed = "no pair: this diagnosis has none" if not pairs else f"0 to {len(pairs) - 1}"
        raise invalid("pair", number, listed, "Hand over two models instead.")
    return pairs[number]


def _alike(machines: Any) -> tuple[MechanicalModel, MechanicalModel]:
    """Return two models that can be compared.

    Raises
    ------
    InvalidInputError
        If they are not two, or have other coordinates, inputs or outputs.
    """
    if not isinstance(machines, Sequence) or [isinstance(m, MechanicalModel) for m in machines] != [
        True, True,
    ]:  # fmt: skip
        shown = described(type(machines).__name__)
        raise invalid("machines", shown, "a Diagnosis, or two models", "Read them with rp.load.")
    first, second = machines
    for what in ("dof_names", "input_names", "output_names"):
        one, other = getattr(first, what), getattr(second, what)
        if tuple(one) != tuple(other):
            shown = described(f"{', '.join(one)} and {', '.join(other)}")
            raise invalid("machines", shown, "the same names in both models", "Rename them.")
    return first, second


def _noise(
    model: MechanicalModel,
    record: Record,
    given: Mapping[str, float] | None,
    diagnosis: Diagnosis | None,
) -> Array:
    """Return the standard deviation of the noise of each output."""
    found = dict(zip(model.output_names, scales_of(model, record).noise.tolist(), strict=True))
    if diagnosis is not None:
        spread = np.std(record.Y, axis=0)
        for name, size in zip(model.output_names, spread, strict=True):
            found[name] = max(diagnosis.noise_floor.get(name, 0.0) * float(size), 1e-300)
    for name, value in (given or {}).items():
        if name not in found:
            raise invalid("noise", name, f"an output: {', '.join(found)}", "Check the name.")
        found[name] = positive(f"noise[{name}]", value, "the unit of the output")
    return np.array([found[name] for name in model.output_names])


def _reach(
    model: MechanicalModel,
    record: Record,
    limits: Mapping[str, float] | None,
    policy: ExperimentPolicy,
) -> Array:
    """Return the largest value that each output may take."""
    known = (*model.input_names, *model.output_names)
    for name, value in (limits or {}).items():
        if name not in known:
            raise invalid("limits", name, f"one of {', '.join(known)}", "Check the name.")
        positive(f"limits[{name}]", value, "its unit")
    seen = policy.reach * np.max(np.abs(record.Y), axis=0)
    found = [
        (limits or {}).get(name, value)
        for name, value in zip(model.output_names, seen, strict=True)
    ]
    return np.maximum(np.array(found, dtype=float), 1e-300)


def _fitted(
    model: MechanicalModel,
    record: Record,
    diagnosis: Diagnosis | None,
    place: int,
    say: Callable[[str], None],
) -> tuple[MechanicalModel, Mapping[str, float], tuple[dict[str, float], Array]]:
    """Return a machine fitted to the record, its errors there, and how well its numbers are known.

    The first machine of a diagnosis was fitted before.
    """
    if diagnosis is not None and place == 0 and model is diagnosis.model:
        return model, diagnosis.ledger.entries[-1].nrmse, ({}, np.zeros((0, 0)))
    say(f"refit of the {('first', 'second')[place]} machine")
    found: Refit = refit(model, record.data)
    return found.model, found.nrmse, numbers_of(found)


def _unknown(model: MechanicalModel, record: Record) -> tuple[dict[str, float], Array]:
    """Return the numbers of a model that a fit would move, with nothing known of them."""
    keys = [f.key for f in free_parameters(model, excited_bandwidth(model, record), POLICY)]
    return dict.fromkeys(keys, np.inf), np.zeros((len(keys), len(keys)))
