"""Free parameters of a fit: keys, scales, bounds and priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.policy import Policy
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import CONSTANT
from robustpolish.machines.effects.spline_law import coefficients_of, spline_basis
from robustpolish.machines.mechanical.data import connected, heaviest, port_row
from robustpolish.machines.mechanical.equations import number_unit
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import FORCE

# Share of the largest force within which a law over the velocity has none at rest, where a law over
# the displacement could have it as well.
_HELD = 1e-3
# How many times steeper a friction may turn over after one fit: a step that goes too far would make
# it jump, and from there no slope leads back.
_STEEPER = 10.0
# How well stiffness and damping are known beforehand, as shares: springs are known roughly, dampers
# hardly ("cubic between, wrong numbers").
_SPRING_PRIOR, _DAMPER_PRIOR = 0.3, 1.0
# Units of numbers of equations that somebody weighed or measured.
_MEASURED = ("kg", "m", "kg m", "kg m^2")
# Bounds of masses and gains, as multiples of what is known.
_WEIGHED = (0.1, 10.0)
_GUESSED = (1e-3, 1e3)
# Share of its natural size up to which a spring or damper is as good as none and may be missing.
_NOTHING = 1e-6
# Share of all that moves which is rounding: what a sensor shows of it is nothing.
_UNOBSERVABLE_SHARE = 1e-9


@dataclass(frozen=True)
class FreeParameter:
    """A number of a model that a fit may change.

    Attributes
    ----------
    key : str
        As in `MechanicalModel.parameters`.
    start, scale : float
        First value, and the unit in which the fit counts.
    lower, upper : float
        Bounds.
    prior : float
        Standard deviation of what is known about it beforehand, about `centre`;
        infinite if nothing is known.
    centre : float
    at_least : str
        Key of another number that this one is never below; empty if there is none.
    """

    key: str
    start: float
    scale: float
    lower: float
    upper: float
    prior: float = np.inf
    centre: float = 0.0
    at_least: str = ""

    @property
    def is_effect(self) -> bool:
        """Whether it belongs to an effect."""
        return self.key.startswith("effect[")


def chain_keys(model: MechanicalModel, chain: set[str]) -> tuple[list[str], list[str], list[str]]:
    """Return the keys of a chain's masses with what couples them, springs and dampers."""
    coupled = enumerate(model.coupled_inertias)
    return (
        [".".join(d.key) for d in model.dofs if d.name in chain and d.mass]
        + [f"coupled_inertia[{i}].value" for i, c in coupled if chain & {*c.between}],
        [f"spring[{i}].stiffness" for i, s in enumerate(model.springs) if chain & {*s.between}],
        [f"damper[{i}].damping" for i, d in enumerate(model.dampers) if chain & {*d.between}],
    )


def inputs_of_chain(model: MechanicalModel, chain: set[str]) -> list[str]:
    """Return the names of the inputs that push a chain."""
    return [i.name for i in model.inputs if i.imposes is None and i.on[0] in chain]


def scale_fixing_masses(model: MechanicalModel) -> dict[str, set[str]]:
    """Return a mass of each chain in which no force is known, and the chain.

    It stays, and gives the forces a unit: a free decay, or a motion under an imposed one, shows
    ratios of masses and springs only. So does a record all of whose inputs or outputs have an
    unknown gain.
    """
    gains = {(e.kind, e.at[0]) for e in model.effects}
    chosen = {}
    for chain in connected(model):
        known = any(
            i.imposes is None and chain.intersection(i.on) and ("input_gain", i.name) not in gains
            for i in model.inputs
        )
        known |= any(o.quantity == FORCE and chain.intersection(o.of) for o in model.outputs)
        seen = [o.name for o in model.outputs if chain.intersection(o.of)]
        known &= not seen or any(("sensor_gain", name) not in gains for name in seen)
        masses = [d for d in model.dofs if d.name in chain and d.name in model.free]
        if not known and masses:
            chosen[max(masses, key=lambda d: d.mass).name] = chain
    return chosen


def with_fixed_force_scale(model: MechanicalModel, reference: MechanicalModel) -> MechanicalModel:
    """Return the model with those masses as they were, the rest of their chains in proportion.

    Parameters
    ----------
    model, reference : MechanicalModel
        Fitted, and before any fit.
    """
    values, known, changes = model.parameters, reference.parameters, {}
    for name, chain in scale_fixing_masses(model).items():
        key = ".".join(model.dof(name).key)
        if known.get(key) and values[key] != known[key]:
            inside = (k for keys in chain_keys(model, chain) for k in keys)
            changes |= {k: values[k] * known[key] / values[key] for k in inside}
    return model.with_parameters(changes) if changes else model


def free_parameters(
    model: MechanicalModel,
    bandwidth: float,
    policy: Policy,
    reference: MechanicalModel | None = None,
) -> list[FreeParameter]:
    """Return the parameters of a model that are fitted.

    Parameters
    ----------
    model : MechanicalModel
    bandwidth : float
        Excited bandwidth in rad/s; gives zero stiffness and damping a scale.
    policy : Policy
    reference : MechanicalModel, optional
        The model before any fit, about which the priors are centred. Of dry friction that it has
        not, and that turns over gently, the speed of the turn is fitted too.
    """
    known = (reference or model).parameters
    given = len((reference or model).effects)
    moving = {*model.free, *(o.of[0] for o in model.outputs if o.drive)} - set(
        scale_fixing_masses(model)
    )
    mass = float(np.mean([d.mass for d in model.dofs if d.mass > 0] or [1.0]))

    def known_to(value: float, centre: float, share: float) -> float:
        """Return how well a number is known: what the data moved far was not known that well."""
        return max(share * abs(centre), abs(value - centre))

    def near(key: str, value: float, share: float) -> FreeParameter:
        """Describe a number that is known rather well."""
        centre = known.get(key, value)
        low, high = sorted(bound * centre for bound in _WEIGHED)
        scale, prior = abs(centre) or 1.0, known_to(value, centre, share)
        return FreeParameter(key, value, scale, low, high, prior, centre)

    def elastic(key: str, value: float, natural: float, share: float) -> FreeParameter:
        """Describe a stiffness or damping: it may be far off, and keeps its sign."""
        centre = known.get(key, 0.0)
        if abs(centre) <= _NOTHING * natural:  # as good as none: it may well be missing
            return FreeParameter(key, value, natural, 0.0, np.inf)
        low, high = (0.0, np.inf) if centre > 0 else (-np.inf, 0.0)
        scale, prior = abs(value) or natural, known_to(value, centre, share)
        return FreeParameter(key, value, scale, low, high, prior, centre)

    result = [
        near(".".join(dof.key), model.dof(dof.name).mass, policy.mass_prior)
        for name, dof in heaviest(reference or model).items()
        if name in moving and ".".join(dof.key) in known
    ]
    for item in model.equations:
        for name, value in item.values.items():
            key, weighed = f"parameter.{name}", number_unit(item, name) in _MEASURED
            if name in item.known:
                continue
            if not known[key]:
                result.append(FreeParameter(key, value, abs(value) or 1.0, -np.inf, np.inf))
            elif weighed:
                result.append(near(key, value, policy.mass_prior))
            else:  # 0 may be a divisor
                centre, scale = known[key], abs(value) or abs(known[key])
                low, high = sorted(bound * centre for bound in _GUESSED)
                prior = known_to(value, centre, _SPRING_PRIOR)
                result.append(FreeParameter(key, value, scale, low, high, prior, centre))
    for i, coupled in enumerate(model.coupled_inertias):
        if any(model.frame.multiples[end][0] in model.free for end in coupled.between):
            key = f"coupled_inertia[{i}].value"
            natural = float(np.sqrt(np.prod([model.dof(end).mass for end in coupled.between])))
            natural, most = natural or mass, _WEIGHED[1] * (natural or mass)
            prior, centre = policy.mass_prior * natural, known.get(key, coupled.value)
            free = FreeParameter(key, coupled.value, natural, -most, most, prior, centre)
            result.append(free)
    contained = parameters_within_laws(model)
    springs = [(f"spring[{i}].stiffness", s.stiffness, mass * bandwidth**2, _SPRING_PRIOR)
               for i, s in enumerate(model.springs)]  # fmt: skip
    dampers = [(f"damper[{i}].damping", d.damping, 0.02 * mass * bandwidth, _DAMPER_PRIOR)
               for i, d in enumerate(model.dampers)]  # fmt: skip
    result += [elastic(*part) for part in [*springs, *dampers] if part[0] not in contained]
    # the gain of the only input of a chain would scale its masses and springs, no more
    pushing = {name for chain in connected(model) if len(inputs_of_chain(model, chain)) > 1
               for name in inputs_of_chain(model, chain)}  # fmt: skip
    result += [
        near(f"input.{item.name}.gain", item.gain, policy.gain_prior)
        for item in model.inputs
        if item.name in pushing
    ]
    for i, effect in enumerate(model.effects):
        turns_over, values = effect.definition.turns_over, effect.values
        rounded = i >= given and has_smoothing(effect)
        for p in effect.definition.parameters:
            key, turns = f"effect[{i}].{p.name}", p.name == turns_over
            if not p.fitted and not (rounded and turns):
                continue
            if p.name not in effect.parameters or key in contained:
                continue
            value, (lower, upper) = values[p.name], p.bounds_from(values)
            lower = max(lower, value / _STEEPER) if turns else lower
            other = f"effect[{i}].{p.at_least}" if p.at_least else ""
            scale = p.scale_from(value, values)
            result.append(FreeParameter(key, value, scale, lower, upper, at_least=other))
    for i, loop in enumerate(model.feedback):
        for name in loop.unknown:  # of any size, of the sign that it has
            value = loop.numbers()[name]
            low, high = (0.0, np.inf) if value >= 0 else (-np.inf, 0.0)
            low = value / _STEEPER if "limit" in name else low
            scale = abs(value) or loop.period
            result.append(FreeParameter(f"feedback[{i}].{name}", value, scale, low, high))
    return result


def is_guessed(key: str) -> bool:
    """Return whether a number is guessed rather than weighed, as springs and dampers are."""
    return key.startswith(("spring", "damper", "parameter"))


def has_smoothing(effect: Effect) -> bool:
    """Return whether an effect is dry friction that turns over within some speed, not at once."""
    return effect.values.get(effect.definition.turns_over, 0.0) > 0.0


def with_effects_at(model: MechanicalModel, at: int, *instead: Effect) -> MechanicalModel:
    """Return a model with others in place of one of its effects, or with none."""
    return replace(model, effects=(*model.effects[:at], *instead, *model.effects[at + 1 :]))


def makes_no_force(effect: Effect) -> bool:
    """Return whether an effect makes no force."""
    sizes = _sizes(effect)
    return bool(sizes) and not any(effect.values[name] for name in sizes)


def _sizes(effect: Effect) -> list[str]:
    return [p.name for p in effect.definition.parameters if p.fitted and p.counts_force]


def scaled_effect(effect: Effect, share: float) -> Effect:
    """Return an effect with a share of its force."""
    sizes = _sizes(effect)
    return effect.with_values({k: share * v if k in sizes else v for k, v in effect.values.items()})


def parameters_within_laws(model: MechanicalModel) -> set[str]:
    """Return the keys of numbers that learned laws at their places contain, and that stay.

    A curve over the displacement holds any spring, one over the velocity any damper, both any
    constant force, and what varies with time the part that does not: fitted beside it, they would
    be shared out at random.
    """
    places = [(f"spring[{i}].stiffness", "spring", s.between) for i, s in enumerate(model.springs)]
    places += [(f"damper[{i}].damping", "damper", d.between) for i, d in enumerate(model.dampers)]
    places += [
        (f"effect[{i}].{e.definition.parameters[0].name}", "constant", (*e.at, "ground"))
        for i, e in enumerate(model.effects)
        if e.definition.domain == "dof" and e.definition.family == CONSTANT
    ]
    found: set[str] = set()
    for law in model.effects:
        contains = {*law.definition.contains}
        if {"displacement", "velocity"} & {*law.definition.over}:
            contains.add("constant")
        found |= {key for key, what, at in places if what in contains and {*at} == {*law.at}}
    return found


def joint_priors(model: MechanicalModel, free: Sequence[FreeParameter]) -> Array:
    """Return rows whose products with the free numbers are standard normal beforehand.

    Parameters
    ----------
    model : MechanicalModel
    free : sequence of FreeParameter

    Returns
    -------
    ndarray, shape (rows, len(free))
        In SI units; none at all where numbers are known one by one only.
    """
    column = {f.key: j for j, f in enumerate(free)}
    blocks = [np.zeros((0, len(free)))]

    def constrain(i: int, names: Sequence[str], rows: Array) -> None:
        """Append rows over numbers of an effect, if all of these are free."""
        keys = [f"effect[{i}].{name}" for name in names]
        if all(key in column for key in keys):
            blocks.append(np.zeros((len(rows), len(free))))
            blocks[-1][:, [column[key] for key in keys]] = rows

    for i, effect in enumerate(model.effects):
        if effect.definition.prior is not None:
            names = [p.name for p in effect.definition.parameters if p.fitted]
            constrain(i, names, effect.definition.prior(effect.values))
    for i in _zero_at_rest(model):
        values = model.effects[i].values
        c = coefficients_of(values)
        stays = model.effects[i].definition.over != ("displacement",)
        at_rest = spline_basis(np.zeros(1), values["low"], values["high"], c.size, stays)[:, 0]
        row = at_rest / (_HELD * (np.max(np.abs(c)) or 1.0))
        constrain(i, list(values)[-c.size :], row[None])
    return np.vstack(blocks)


def _zero_at_rest(model: MechanicalModel) -> list[int]:
    """Return which effects are laws whose force at rest the data do not tell from something else.

    Beside a law over the displacement one over the velocity has none: the other has it. A law over
    a displacement whose rest no sensor shows is counted from there: another force at rest and
    another place to count from are one motion.
    """
    over = [(e.definition.over, set(e.at)) for e in model.effects]
    springs = [at for what, at in over if what == ("displacement",)]
    return [
        i
        for i, (what, at) in enumerate(over)
        if (what == ("velocity",) and at in springs)
        or (what == ("displacement",) and not _static_force_observable(model, model.effects[i].at))
    ]


def _static_force_observable(model: MechanicalModel, at: tuple[str, ...]) -> bool:
    """Return whether a constant force at a place changes what sensors show at rest.

    With a displacement of one of two masses none does of a force between them, which their spring
    balances. What is measured as a force shows in any case.
    """
    matrices = model.matrices
    if any(output.quantity == FORCE for output in model.outputs):
        return True
    free = matrices.free
    K, Sq = matrices.K[free][:, free], matrices.Sq[:, free]
    moved = np.linalg.lstsq(K, port_row(model, at)[free], rcond=None)[0]
    least = _UNOBSERVABLE_SHARE * np.sum(np.abs(Sq), axis=1) * np.max(np.abs(moved), initial=0.0)
    return bool(np.any(np.abs(Sq @ moved) > least))
