"""A mechanical model with numbers that are known within bounds only, as an uncertain system."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.models.mechanical.data import MechanicalData, replaced, values
from robustpolish.models.mechanical.matrices import MechanicalMatrices
from robustpolish.models.uncertain.elements import Block, RealElement, real_element
from robustpolish.models.uncertain.lft import Lft, reduced
from robustpolish.models.uncertain.substitution import closed
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.validation import described, invalid, spelled

# Size of a singular value, relative, below which it is the rounding of a difference.
_NOTHING = 1e-12
# Before the name of an element in whose place a number made of others is put.
_STAND_IN = "value of "


def uncertain_model(model: MechanicalData, ranges: Mapping[str, Any]) -> UncertainSystem:
    """Return the linear part with uncertain numbers; see :meth:`MechanicalModel.uncertain`.

    Every number enters the forces and outputs linearly, a mass by the acceleration: the force and
    output that come with its change are a few signals that go through its delta.
    """
    given = dict(_checked(ranges))
    numbers = {key: value for key, value in given.items() if isinstance(value, UncertainSystem)}
    model = replaced(model, {key: _nominal(model, key, n) for key, n in numbers.items()})
    elements = [_element(model, key, value) for key, value in given.items()]
    m = model.matrices
    pieces = [_pieces(model, element) for element in elements]
    forces = np.hstack([np.zeros((len(m.coordinates), 0)), *(left[0] for left, _ in pieces)])
    motions = [np.vstack([np.zeros((0, M.shape[1])), *(right[i] for _, right in pieces)])
               for i, M in enumerate((m.Sq, m.Sv, m.Sa))]  # fmt: skip
    deltas, first = forces.shape[1], len(m.force_inputs)
    wider = replace(
        m,
        B=np.hstack([forces, m.B]),
        Sq=np.vstack([motions[0], m.Sq]),
        Sv=np.vstack([motions[1], m.Sv]),
        Sa=np.vstack([motions[2], m.Sa]),
        force_inputs=(*(f"w[{i}]" for i in range(deltas)), *m.force_inputs),
        outputs=(*(f"z[{i}]" for i in range(deltas)), *m.outputs),
    )
    A, B, C, D = wider.first_order()
    if deltas:
        D[deltas:, :deltas] += np.hstack([left[1] for left, _ in pieces])
        D[:deltas, deltas : deltas + first] += np.vstack([right[3] for _, right in pieces])
    scale = np.array([e.slope for e, (left, _) in zip(elements, pieces, strict=True)
                      for _ in range(left[0].shape[1])])  # fmt: skip
    skew = np.array([e.skew for e, (left, _) in zip(elements, pieces, strict=True)
                     for _ in range(left[0].shape[1])])  # fmt: skip
    # w = slope delta z / (1 - skew delta), as a fraction of the delta.
    C[:deltas] *= scale[:, None]
    D[:deltas] *= scale[:, None]
    whole = Lft(
        np.block([[A, B[:, :deltas]], [C[:deltas], D[:deltas, :deltas] + np.diag(skew)]]),
        np.vstack([B[:, deltas:], D[:deltas, deltas:]]),
        np.hstack([C[deltas:], D[deltas:, :deltas]]),
        D[deltas:, deltas:],
        m.states,
        tuple(Block(_renamed(e, numbers), left[0].shape[1])
              for e, (left, _) in zip(elements, pieces, strict=True) if left[0].shape[1]),
        0,
        m.signals,
        m.outputs,
    )  # fmt: skip
    for key, number in numbers.items():
        whole = _with_number(whole, key, number)
    return UncertainSystem(reduced(whole))


def _nominal(model: MechanicalData, key: str, number: UncertainSystem) -> float:
    """Return the nominal value of a number that is made of others; also refuse a wrong key."""
    _known(model, key)
    if number.shape != (1, 1) or not number.is_static:
        shown = described(f"an uncertain system, {number.shape[0]} x {number.shape[1]}")
        raise invalid(("ranges", key), shown, "an uncertain number", "Make it of uncertain_real.")
    return float(number.matrices.J[0, 0])


def _with_number(whole: Lft, key: str, number: UncertainSystem) -> Lft:
    """Put a number that is made of others in place of one of slope 1."""
    names = [block.element.name for block in whole.blocks]
    if _STAND_IN + key not in names:
        return whole  # it does nothing
    change = number - number.matrices.J
    return closed(whole, names.index(_STAND_IN + key), change.matrices)


def _checked(ranges: Any) -> Mapping[str, Any]:
    if not isinstance(ranges, Mapping):
        remedy = 'Write {"spring[0].stiffness": 0.1} for 10 %.'
        raise invalid("ranges", ranges, "a mapping of keys to ranges", remedy)
    return ranges


def _renamed(element: RealElement, numbers: Mapping[str, Any]) -> RealElement:
    """Return the element that stands in for a number made of others by a name of its own."""
    own = element.name in numbers
    return replace(element, name=_STAND_IN + element.name) if own else element


def _known(model: MechanicalData, key: str) -> float:
    """Return the value of a number that may be uncertain."""
    known = values(model)
    if key not in known:
        remedy = spelled(key, known)
        raise invalid("ranges", key, f"a key of model.parameters: {', '.join(known)}", remedy)
    if key.startswith("effect["):
        shown = described(f"{key}, a number of an effect")
        expected = "numbers of masses, springs, dampers and gains"
        raise invalid("ranges", shown, expected, "Put the linear part of the effect into a spring.")
    imposing = {f"input.{item.name}.gain" for item in model.inputs if item.imposes}
    if key in imposing:
        shown = described(f"{key}, of an imposed motion")
        raise invalid(
            "ranges", shown, "gains of forces", "Multiply the system by an uncertain_real."
        )
    return known[key]


def _element(model: MechanicalData, key: str, given: Any) -> RealElement:
    """Return the element of a number: a share of it, or its smallest and largest value."""
    nominal = _known(model, key)
    if isinstance(given, UncertainSystem):
        return RealElement(key, nominal, nominal - 1, nominal + 1)  # of slope 1
    if isinstance(given, tuple | list | np.ndarray):
        return real_element(key, nominal, low_high=tuple(given))  # type: ignore
    if not isinstance(given, int | float | np.number) or isinstance(given, bool):
        expected = "a share such as 0.1, (low, high), or an uncertain number"
        raise invalid(("ranges", key), given, expected, "Write 0.1 for 10 %.")
    if nominal == 0:
        shown = described(f"a share of {key}, which is 0")
        raise invalid(("ranges", key), shown, "(low, high)", "Give both ends in its own unit.")
    if key.startswith("dof.") and given >= 1:
        raise invalid(("ranges", key), given, "a share below 1", "A mass stays positive.")
    return real_element(key, nominal, percent=100 * float(given))


def _pieces(
    model: MechanicalData, element: RealElement
) -> tuple[tuple[Matrix, Matrix], tuple[Matrix, Matrix, Matrix, Matrix]]:
    """Return what forces and outputs come with a change of a number, and of what motions."""
    # All matrices are linear in every number: a difference is a derivative.
    step = element.nominal or 1.0
    moved = replaced(model, {element.name: element.nominal + step}).matrices
    m = model.matrices
    if len(moved.signals) != len(m.signals):
        raise _coupled(element)
    n, outputs = len(m.coordinates), len(m.outputs)
    inputs = m.B.shape[1]
    change = np.zeros((n + outputs, 3 * n + inputs))
    for columns, name, out in ((0, "K", "Sq"), (n, "C", "Sv"), (2 * n, "M", "Sa")):
        change[:n, columns : columns + n] = -_slope(moved, m, name, step)
        change[n:, columns : columns + n] = _slope(moved, m, out, step)
    change[:n, 3 * n :] = _slope(moved, m, "B", step)
    change[m.imposed] = 0.0  # their motion is given, whatever force it takes
    if change[:n, 2 * n + m.imposed].any():
        raise _coupled(element)
    U, sizes, V = np.linalg.svd(change)
    rank = int(np.count_nonzero(sizes > _NOTHING * sizes.max(initial=0.0)))
    left, right = U[:, :rank], sizes[:rank, None] * V[:rank]
    return (left[:n], left[n:]), (
        right[:, :n],
        right[:, n : 2 * n],
        right[:, 2 * n : 3 * n],
        right[:, 3 * n :],
    )


def _coupled(element: RealElement) -> Exception:
    shown = described(f"{element.name}, which couples to an imposed motion")
    return invalid("ranges", shown, "inertias of free coordinates", "Leave it certain.")


def _slope(moved: MechanicalMatrices, m: MechanicalMatrices, name: str, step: float) -> Matrix:
    return (getattr(moved, name) - getattr(m, name)) / step
