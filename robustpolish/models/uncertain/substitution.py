"""Values in place of what is uncertain: given ones, nominal ones, and random ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import control
import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.models.uncertain.elements import Block, ComplexElement, Element, RealElement
from robustpolish.models.uncertain.groups import by_element, drawn, groups
from robustpolish.models.uncertain.lft import (
    Lft,
    appended,
    constant,
    exposed,
    repeated,
    wired,
)
from robustpolish.validation import described, invalid, spelled


def substituted(system: Lft, values: Mapping[str, Any]) -> Lft:
    """Return the system with values in place of some of its elements."""
    values = by_element(system.blocks, values)
    known = [block.element.name for block in system.blocks]
    for name in values:
        if name not in known:
            raise invalid("values", name, f"names among {', '.join(known)}", spelled(name, known))
    for name, value in values.items():
        index = [block.element.name for block in system.blocks].index(name)
        block = system.blocks[index]
        system = closed(system, index, normalised(block.element, value, system.dt))
    return system


def normalised(element: Element, value: Any, dt: Any) -> Lft:
    """Return the delta of an element that stands for a value, as a real system."""
    if isinstance(element, RealElement):
        return constant(np.array([[element.delta(value)]]))
    if not isinstance(value, control.LTI) and np.any(np.imag(value)):
        raise invalid(
            element.name,
            value,
            "a real number or a stable system",
            "A complex number is no real system: pass one that has this value at a frequency.",
        )
    plain = value if isinstance(value, control.LTI) else np.real(value)
    system = lifted(as_state_space(element.name, plain, dt))
    if system.shape != element.shape:
        shown = described(f"{system.shape[0]} x {system.shape[1]}")
        wanted = f"{element.shape[0]} x {element.shape[1]}"
        raise invalid(element.name, shown, wanted, "Check its inputs and outputs.")
    if isinstance(element, ComplexElement):
        radius, J = element.radius, system.J - element.nominal
        return Lft(system.F, system.G, system.H / radius, J / radius, system.states, (), system.dt)
    return system


def closed(system: Lft, index: int, delta: Lft) -> Lft:
    """Return the system with a delta in place of a block."""
    block = system.blocks[index]
    opened = exposed(system, index)
    both = appended([opened, repeated(delta, block.copies)])
    z, w = block.columns, block.rows
    ny, nu = system.shape
    loop = np.zeros((w + nu + z, z + ny + w))  # inputs: w, u, delta's z; outputs: z, y, delta's w
    loop[:w, z + ny :] = np.eye(w)
    loop[w + nu :, :z] = np.eye(z)
    enter, leave = np.zeros((w + nu + z, nu)), np.zeros((ny, z + ny + w))
    enter[w : w + nu] = np.eye(nu)
    leave[:, z : z + ny] = np.eye(ny)
    return wired(both, loop, enter, leave).names(system.inputs, system.outputs)


def nominal(system: Lft) -> Lft:
    """Return the system with every delta 0."""
    n = len(system.states)
    return replace(system, F=system.F[:n, :n], G=system.G[:n], H=system.H[:, :n], blocks=())


def lifted(system: control.StateSpace) -> Lft:
    """Return a certain system as one without blocks."""
    n, m, p = system.nstates, system.ninputs, system.noutputs
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(shape)
        for name, shape in zip("ABCD", ((n, n), (n, m), (p, n), (p, m)), strict=True)
    )
    if n == 0:
        return Lft(A, B, C, D, (), (), None, *_labels(system))
    return Lft(A, B, C, D, tuple(system.state_labels), (), system.dt, *_labels(system))


def _labels(system: control.StateSpace) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(system.input_labels), tuple(system.output_labels)


def random_values(system: Lft, random: np.random.Generator) -> dict[str, Any]:
    """Draw values of all elements: numbers evenly within their bounds, dynamics as all-passes."""
    values: dict[str, Any] = {}
    for members in groups(system.blocks):
        values |= drawn(members, random)
    for block in system.blocks:
        if block.element.name not in values:
            values[block.element.name] = _random_value(block, system, random)
    return values


def _random_value(block: Block, system: Lft, random: np.random.Generator) -> Any:
    element = block.element
    if isinstance(element, RealElement):
        return float(random.uniform(element.low, element.high))
    if isinstance(element, ComplexElement):
        return element.nominal + element.radius * _all_pass((1, 1), system, random)
    return _all_pass(element.shape, system, random)


def _all_pass(
    shape: tuple[int, int], system: Lft, random: np.random.Generator
) -> control.StateSpace:
    """Draw a stable system whose gain is at most 1, with a lag at a rate of the system."""
    p, q = shape
    gain: Matrix = random.standard_normal((p, q))
    gain *= np.sqrt(random.uniform()) / np.linalg.norm(gain, 2)
    n = len(system.states)
    rates = np.abs(np.linalg.eigvals(system.F[:n, :n])) if n else np.zeros(0)
    sign = random.choice([-1.0, 1.0])
    spread = float(np.exp(random.normal()))
    if system.dt:
        pole = float(random.uniform(-0.9, 0.9))
        a, b = pole, 1 - pole**2
        lag = (np.eye(q) * a, np.eye(q), np.eye(q) * b, np.eye(q) * -pole)
    else:
        rates = rates[rates > 0]
        rate = spread * (float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0)
        lag = (np.eye(q) * -rate, np.eye(q), np.eye(q) * -2 * rate, np.eye(q))
    A, B, C, D = lag
    return control.StateSpace(A, B, sign * gain @ C, sign * gain @ D, system.dt or 0)
