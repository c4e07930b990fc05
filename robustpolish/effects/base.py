"""What a physical effect is: a force law with named parameters, and where it acts.

A kind (:class:`EffectKind`) is the description; an :class:`Effect` is a kind at
a place with numbers. Effects know no models: a model gives the relative motion
at the place and takes the force.

::

    at = ("x", "x_m")      q = x - x_m,  v = dq/dt
                           +f acts on x, -f acts on x_m   (ground takes the rest)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects.shapes import Motion, Shape
from robustpolish.validation import invalid

Domain = Literal["pair", "dof", "axes", "input", "output"]
Law = Callable[[Any, Any, Any, Any, Any, Any, Any], None]

GROUND = "ground"
CONSTANT = "constant"
"""The family of forces and offsets that never change."""
_PLACES: dict[str, int] = {"pair": 2, "dof": 1, "axes": 2, "input": 1, "output": 1}
_SI = {"F": ("N", "N m"), "L": ("m", "rad"), "T": ("s", "s"), "M": ("kg", "kg m^2")}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a kind of effect.

    Parameters
    ----------
    name : str
    dimension : str
        In F (force or torque), L (length or angle), M (mass or inertia), T (time), such as
        ``"F/L^3"``; "rad" and "1" stay, "signal" is the unit of the output.
    meaning : str
        What it is, in a few words.
    lower, upper : float
        Physical bounds; a fit that ends outside has the wrong effect.
    default : float
        Value when none is given.
    fitted : bool
        False for what the data hardly determines (a smoothing width); it is
        fitted on request only.
    """

    name: str
    dimension: str
    meaning: str
    lower: float = -np.inf
    upper: float = np.inf
    default: float = 0.0
    fitted: bool = True

    def unit(self, rotational: bool = False) -> str:
        """Return the SI unit, for translation or for rotation.

        Parameters
        ----------
        rotational : bool, optional

        Returns
        -------
        str

        Examples
        --------
        >>> Parameter("stiffness", "F/L^3", "cubic coefficient").unit()
        'N/m^3'
        """
        if self.dimension in ("1", "rad", "signal"):
            return self.dimension
        unit = "".join(_SI[c][rotational] if c in _SI else c for c in self.dimension)
        return unit.replace("*", " ")


def _no_gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def _no_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return ()


def _plausible(values: Mapping[str, float]) -> str | None:
    return None


def _no_shapes(motion: Motion) -> list[Shape]:
    return []


@dataclass(frozen=True)
class EffectKind:
    """One kind of physical effect; one of these per file.

    Parameters
    ----------
    kind : str
        Its name, as in model files.
    title : str
        For people.
    domain : {"pair", "dof", "axes", "input", "output"}
        Where it acts: between two degrees of freedom (or one and ground), on
        one, on two axes, on a force input, on a sensor.
    parameters : tuple of Parameter
    law : callable, optional
        ``law(t, q, v, z, p, f, dz)`` writes the force ``f`` on the first degree
        of freedom and the derivatives ``dz`` of the internal states, from time,
        relative displacement and velocity (one entry per port), states and
        parameters (in the order of `parameters`, then `context`). Plain Python
        that Numba can compile. None for inputs and outputs.
    shapes : callable
        ``shapes(motion)`` gives the candidate forces used for screening.
    states : int
        Number of internal states.
    context : tuple of str
        What the law needs of the model: ``"spring_stiffness"`` (N/m, of the
        spring at the place), ``"clearance"`` (m, of a backlash at the place),
        ``"spin_frequency"`` (rad/s), ``"mobility"``
        (time step over the effective mass, s/kg: no velocity below force times
        mobility can be resolved).
    gains : callable
        ``gains(values, q, v)`` gives the largest stiffness and damping that the
        law adds at the amplitudes q and v, and the fastest rate in 1/s of its
        internal states; decides on substeps.
    state_sizes : callable
        ``state_sizes(values, q, v)`` gives the size of each internal state at the amplitudes q
        and v.
    implausible : callable
        ``implausible(values)`` says why values cannot be physical, or None.
    family : str
        Kinds of one family are rivals: a place has one of them at most.
    sharp : bool
        Whether the force has corners or jumps, so that steps have to be short.
    looks_like, checks, references
        What it does to the residual, what to check on the machine, sources.
    """

    kind: str
    title: str
    domain: Domain
    parameters: tuple[Parameter, ...]
    law: Law | None = None
    shapes: Callable[[Motion], list[Shape]] = _no_shapes
    states: int = 0
    context: tuple[str, ...] = ()
    gains: Callable[[Mapping[str, float], float, float], tuple[float, float, float]] = _no_gains
    state_sizes: Callable[[Mapping[str, float], float, float], tuple[float, ...]] = _no_sizes
    implausible: Callable[[Mapping[str, float]], str | None] = _plausible
    family: str = ""
    sharp: bool = False
    looks_like: str = ""
    checks: tuple[str, ...] = ()
    references: tuple[str, ...] = ()

    @property
    def places(self) -> int:
        """Number of names in `at`."""
        return _PLACES[self.domain]

    @property
    def ports(self) -> int:
        """Number of forces that the law writes."""
        return 2 if self.domain == "axes" else 1

    @property
    def has_memory(self) -> bool:
        """Whether the force depends on the past."""
        return self.states > 0

    def parameter(self, name: str) -> Parameter:
        """Return the parameter called `name`.

        Parameters
        ----------
        name : str

        Returns
        -------
        Parameter

        Raises
        ------
        InvalidInputError
            If the kind has none of that name.
        """
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        listed = ", ".join(p.name for p in self.parameters)
        raise invalid(
            f"{self.kind}.parameters", name, f"one of {listed}", "Check the parameter's name."
        )


@dataclass(frozen=True)
class Effect:
    """A kind of effect at a place, with numbers.

    Parameters
    ----------
    kind : str
        Name in the catalogue, see :func:`robustpolish.effects.kinds`.
    at : sequence of str
        Names of degrees of freedom ("ground" included), of an input or output.
    parameters : mapping of str to float
        SI values; those not given take the kind's defaults.

    Raises
    ------
    InvalidInputError
        For an unknown kind or parameter, a wrong number of places, or a value
        that is not finite.

    Examples
    --------
    >>> friction = Effect("coulomb_friction", ("x", "ground"), {"force": 3.1})
    >>> friction.values["force"], friction.definition.parameter("force").unit()
    (3.1, 'N')
    """

    kind: str
    at: tuple[str, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        definition = self.definition
        object.__setattr__(self, "at", _places(definition, self.at))
        object.__setattr__(self, "parameters", _numbers(definition, self.parameters))

    @property
    def definition(self) -> EffectKind:
        """The kind's description."""
        from robustpolish.effects.registry import lookup  # the registry imports this module

        return lookup(self.kind)

    @property
    def values(self) -> dict[str, float]:
        """All parameters in the kind's order, defaults filled in."""
        given = self.parameters
        return {p.name: given.get(p.name, p.default) for p in self.definition.parameters}

    def with_parameters(self, **changes: float) -> Effect:
        """Return the same effect with some parameters changed.

        Parameters
        ----------
        **changes : float
            New values in SI units.

        Returns
        -------
        Effect
        """
        return Effect(self.kind, self.at, {**self.parameters, **changes})

    def __str__(self) -> str:
        return f"{self.kind} at {', '.join(self.at)}"


def _places(definition: EffectKind, at: Any) -> tuple[str, ...]:
    names = (at,) if isinstance(at, str) else tuple(at)
    if definition.domain == "pair" and len(names) == 1:
        names = (*names, GROUND)
    if definition.domain == "dof" and len(names) == 2 and names[1] == GROUND:
        names = names[:1]
    bad = len(names) != definition.places or not all(isinstance(n, str) and n for n in names)
    if bad or len(set(names)) != len(names) or names[0] == GROUND:
        what = {
            "pair": "two different degrees of freedom, the first not ground",
            "dof": "one degree of freedom",
            "axes": "two degrees of freedom",
            "input": "the name of one input",
            "output": "the name of one output",
        }[definition.domain]
        raise invalid(f"{definition.kind}.at", at, what, "Name where the effect acts.")
    return names


def _numbers(definition: EffectKind, parameters: Any) -> dict[str, float]:
    if not isinstance(parameters, Mapping):
        raise invalid(
            f"{definition.kind}.parameters", parameters, "a table of numbers", "Write name = value."
        )
    numbers: dict[str, float] = {}
    for name, value in parameters.items():
        definition.parameter(name)
        bad = isinstance(value, bool) or not isinstance(value, int | float | np.number)
        if bad or not np.isfinite(float(value)):
            raise invalid(f"{definition.kind}.{name}", value, "a finite number", "Check the value.")
        numbers[name] = float(value)
    return numbers


@lru_cache(maxsize=256)
def compiled_law(kind: EffectKind) -> Any:
    """Return the law compiled to one signature, so that kernels can call any of them."""
    import numba

    if kind.law is None:
        raise invalid("kind", kind.kind, "an effect with a force law", "Choose another kind.")
    return numba.njit(law_signature(), cache=True, error_model="numpy")(kind.law)


@lru_cache(maxsize=1)
def law_signature() -> Any:
    """Return the Numba signature of a force law."""
    from numba import types

    array = types.float64[::1]
    return types.void(types.float64, array, array, array, array, array, array)


def force_along(
    kind: EffectKind, motion: Motion, values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the force of a law along a given motion, shape (ports, samples).

    Internal states start at rest and are stepped with the motion (Heun).

    Parameters
    ----------
    kind : EffectKind
    motion : Motion
    values : ndarray
        Of the parameters, in the kind's order.

    Returns
    -------
    ndarray, shape (ports, samples)
    """
    from robustpolish.effects.along import run

    names = (p.name for p in kind.parameters)
    fastest = float(np.max(np.abs(motion.v), initial=0.0))
    numbers = dict(zip(names, np.asarray(values, dtype=float).tolist(), strict=False))
    rate = kind.gains(numbers, motion.amplitude, fastest)[2] if kind.states else 0.0
    law = compiled_law(kind)
    return run(law, kind.states, motion, np.ascontiguousarray(values, dtype=float), rate)
