"""Whatever users call a system, read as a state-space system: this is the one place for it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from control.exception import ControlMIMONotImplemented
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyVector, Vector
from robustpolish.base.checks import described, invalid, matrix, misfit, state_space

_SYSTEMS = (
    "a control.StateSpace, a control.TransferFunction, a system of scipy.signal or an object with "
    "a method state_space()"
)
_KINDS = f"{_SYSTEMS}; or a gain"
_PARTS = ("system", "closed_loop", "controller", "open_loop", "pade_model()")
"""Where results keep the systems they hold."""


def named_system(
    matrices: Sequence[ArrayLike],
    dt: float | bool,
    inputs: Sequence[str],
    outputs: Sequence[str],
    states: Sequence[str] = (),
) -> control.StateSpace:
    """Return the system of A, B, C, D with these names, states without effect kept.

    Parameters
    ----------
    matrices : sequence of array_like
        A, B, C and D.
    dt : float or True
        Sampling time in s; 0 is continuous time.
    inputs, outputs, states : sequence of str
        Names.

    Returns
    -------
    control.StateSpace
    """
    names = {"inputs": list(inputs), "outputs": list(outputs), "states": list(states)}
    A, B, C, D = matrices
    if not names["inputs"]:
        # python-control loses a single row without columns: an input stands in for it.
        n, p = len(names["states"]), len(names["outputs"])
        padded = (A, np.zeros((n, 1)), C, np.zeros((p, 1)))
        names["inputs"] = ["none"]
        system = control.StateSpace(*padded, dt, remove_useless_states=False, **names)
        system.set_inputs([])
        system.B, system.D = np.zeros((n, 0)), np.zeros((p, 0))
        return system
    return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **names)


# How far, relative, a realisation may lie from its transfer function at the points of the check.
_SAME_RESPONSE = 1e-6


def is_system(value: Any) -> bool:
    """Return whether :func:`as_state_space` takes a value for a system rather than a gain."""
    known = isinstance(value, control.InputOutputSystem | control.LTI) or _is_of_scipy(value)
    return known or hasattr(value, "state_space")


def as_system(argument: str, value: Any) -> control.StateSpace:
    """Return a system as :func:`as_state_space` does; a gain is refused."""
    if not is_system(value):
        parts = [f".{name}" for name in _PARTS if name.rstrip("()") in dir(value)]
        remedy = f"Take its {' or '.join(parts)}." if parts else "Convert it with control.ss(...)."
        raise invalid(argument, described(type(value).__name__), _SYSTEMS, remedy)
    return as_state_space(argument, value)


def _is_of_scipy(value: Any) -> bool:
    return type(value).__module__.startswith("scipy.signal")  # whose import takes long


def as_state_space(
    argument: str,
    value: Any,
    dt: float | bool | None = None,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> control.StateSpace:
    """Return a system of any kind, or a gain, as a state-space system.

    Parameters
    ----------
    argument : str
        Name of the argument, for messages.
    value : control.StateSpace, control.TransferFunction, scipy.signal.lti or dlti or array_like
        Or an object with a method ``state_space()``, such as a MechanicalModel, or an
        UncertainSystem in which nothing is uncertain.
        A state-space system comes back as it is. The states of a realised transfer function
        have no meaning; one of several inputs or outputs takes slycot, which realises it with the
        fewest states.
    dt : float, True or None, optional
        Sampling time of what has none of its own.
    inputs, outputs : sequence of str, optional
        Names of what is no state-space system; those of the transfer function by default.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    InvalidInputError
        If it is of another kind, has entries that are not finite, or is improper.
    """
    if isinstance(value, control.StateSpace):
        return state_space(argument, value)
    if isinstance(value, control.TransferFunction):
        return _realised(argument, value, dt, inputs, outputs)
    if hasattr(value, "state_space"):
        return as_state_space(argument, value.state_space(), dt)
    if _is_of_scipy(value):
        return _of_scipy(argument, value, dt)
    if isinstance(value, control.InputOutputSystem | control.LTI) or hasattr(value, "dims"):
        remedy = "Fit or linearise it first. Of a response loop_analysis gives the margins."
        raise misfit(argument, type(value).__name__, _KINDS, remedy)
    if value is None or isinstance(value, str):
        raise invalid(argument, value, _KINDS, "Pass one of these.")
    gain = matrix(argument, value)
    rows, columns = gain.shape
    if (rows == 0) != (columns == 0):
        shown = described(f"shape {gain.shape}")
        raise invalid(argument, shown, "a gain with entries", "Give a row per output.")
    inputs = inputs or [f"u[{i}]" for i in range(columns)]
    outputs = outputs or [f"y[{i}]" for i in range(rows)]
    return named_system(([], [], [], gain), dt or 0, inputs, outputs)


def _realised(
    argument: str, system: control.TransferFunction, dt: Any, inputs: Any, outputs: Any
) -> control.StateSpace:
    """Realise a proper transfer function; see :func:`as_state_space`."""
    every = [n for pair in (system.num_list, system.den_list) for row in pair for n in row]
    if not all(np.isfinite(n).all() for n in every):
        shown = described("coefficients that are not finite")
        raise invalid(argument, shown, "finite numbers", "Check its coefficients.")
    pairs = zip(system.num_list, system.den_list, strict=True)
    if any(n.size > d.size for row in pairs for n, d in zip(*row, strict=True)):
        want, remedy = "one with no more zeros than poles", "Add a lag to its derivative action."
        raise invalid(argument, described("an improper TransferFunction"), want, remedy)
    time = system.dt if system.dt is not None else dt
    timed = control.TransferFunction(system.num_list, system.den_list, time)
    single = system.ninputs == system.noutputs == 1
    try:
        found: Any = control.ss(
            timed,
            method="scipy" if single else None,
            inputs=list(system.input_labels if inputs is None else inputs),
            outputs=list(system.output_labels if outputs is None else outputs),
        )
    except (ControlMIMONotImplemented, ImportError):
        shown = "a TransferFunction of several inputs or outputs, and slycot is missing"
        remedy = "Install slycot, or pass a state-space realisation."
        raise invalid(argument, described(shown), "a control.StateSpace", remedy) from None
    if single:
        return found
    # No routine is believed: the realisation has to have the response that it realises.
    dens = [np.roots(d) for row in system.den_list for d in row]
    sizes = np.abs(np.concatenate([*dens, [1.0]]))
    scale = float(np.median(sizes[sizes > 0]))
    for factor in (0.03, 0.4, 1.1, 3.0, 40.0):
        s = 1.2 * np.exp(0.7j * factor) if timed.isdtime(strict=True) else scale * factor * 1j
        s = complex(s) + 0.1 * scale * factor  # off the axis, where poles may lie
        want, have = np.atleast_2d(timed(s)), np.atleast_2d(found(s))
        if not np.abs(want - have).max() <= _SAME_RESPONSE * np.abs(want).max():
            shown = described("a TransferFunction whose realisation has another response")
            remedy = "Build it as a control.StateSpace."
            raise invalid(argument, shown, "one that can be realised in double precision", remedy)
    return found


def _of_scipy(argument: str, value: Any, dt: Any) -> control.StateSpace:
    """Return a system of scipy.signal, whose zeros and poles need no polynomials."""
    time = value.dt if value.dt is not None else dt or 0
    if hasattr(value, "A") or np.ndim(getattr(value, "num", ())) > 1:
        found = value.to_ss()
        matrices = found.A, found.B, found.C, found.D
        return as_state_space(argument, control.StateSpace(*matrices, time))
    if hasattr(value, "gain") and len(value.zeros) <= len(value.poles):
        zeros, poles = (np.array(roots, dtype=complex) for roots in (value.zeros, value.poles))
        return of_roots(zeros, poles, float(value.gain), time)
    found = value.to_tf()
    return as_state_space(argument, control.TransferFunction(found.num, found.den, time))


def of_roots(
    zeros: AnyVector, poles: AnyVector, gain: float, dt: Any = 0, about: float = 0.0
) -> control.StateSpace:
    """Return the system of zeros and poles, counted from `about`, as sections in a row.

    Polynomials of degree two at most keep the digits of roots that are small beside the others.
    """
    found = control.StateSpace([], [], [], [[gain]], dt)
    for den, num in itertools.zip_longest(
        real_factors(poles), real_factors(zeros), fillvalue=np.ones(1)
    ):
        n = len(den) - 1  # controllable form, in time units of its own rate
        rate = float(np.abs(den[-1]) ** (1 / n)) or 1.0
        powers = rate ** np.arange(n + 1)
        num, den = np.pad(num, (n + 1 - len(num), 0)) / powers, den / powers
        A = about * np.eye(n) + np.vstack([-den[1:], np.eye(n - 1, n)]) * rate
        row = num[1:] - num[0] * den[1:]
        found = control.StateSpace(A, np.eye(n, 1) * rate, row, num[0], dt) * found
    return found


def real_factors(roots: AnyVector) -> list[Vector]:
    """Return real polynomials of degree two, and at last one of degree one if the number is odd."""
    upper = sorted((s for s in roots.tolist() if s.imag > 1e-9 * abs(s)), key=abs)
    real = sorted((s.real for s in roots.tolist() if abs(s.imag) <= 1e-9 * abs(s)), key=abs)
    double = [np.array([1.0, -2 * s.real, abs(s) ** 2]) for s in upper]
    double += [np.poly(real[i : i + 2]) for i in range(0, len(real) - 1, 2)]
    ordered = sorted(double, key=lambda p: p[-1])
    return ordered + ([np.poly(real[-1:])] if len(real) % 2 else [])
