"""Checks that concern the parts of a mechanical model together, not one part alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from robustpolish.effects import GROUND, Effect
from robustpolish.models.mechanical.parts import (
    ACCELERATION,
    DISPLACEMENT,
    FORCE,
    NO_ENERGY,
    QUANTITIES,
    ROTATIONAL_ONLY,
    VELOCITY,
    CoupledInertia,
    Damper,
    Dof,
    Input,
    Output,
    Spring,
    imposed_by,
    least_energy,
    mass_matrix,
    number,
    places,
)
from robustpolish.validation import Key, described, instance_of, invalid, one_of, positive

_KINDS: Mapping[str, type] = {
    "dofs": Dof,
    "springs": Spring,
    "dampers": Damper,
    "inputs": Input,
    "outputs": Output,
    "effects": Effect,
    "coupled_inertias": CoupledInertia,
}


def checked_fields(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a model, checked against each other, lists turned into tuples.

    Parameters
    ----------
    given : mapping
        The fields of `MechanicalData` by name.

    Returns
    -------
    dict

    Raises
    ------
    InvalidInputError
        See `MechanicalData`; its key says where.
    """
    found = {name: _tuple_of(name, given[name], kind) for name, kind in _KINDS.items()}
    dofs = {dof.name: dof for dof in found["dofs"]}
    _check_names(found["dofs"], found["inputs"], found["outputs"])
    spin = given["spin_frequency"]
    if spin is not None:
        spin = positive("spin_frequency", number("spin_frequency", spin), "Hz")
    if not isinstance(given["name"], str):
        raise invalid("name", given["name"], "text", "Write it between quotation marks.")
    found["springs"] = _connections("spring", "stiffness", found["springs"], dofs)
    found["dampers"] = _connections("damper", "damping", found["dampers"], dofs)
    found["inputs"] = tuple(_input(item, dofs) for item in found["inputs"])
    _check_imposed_motions(found["inputs"], dofs)
    moved = imposed_by(found["inputs"])
    found["coupled_inertias"] = _coupled(found["coupled_inertias"], dofs)
    check_inertias(found["dofs"], found["coupled_inertias"], moved)
    found["outputs"] = tuple(_output(item, dofs, moved) for item in found["outputs"])
    signals = {key: [i.name for i in found[f"{key}s"]] for key in ("input", "output")}
    for i, effect in enumerate(found["effects"]):
        _check_place(("effect", i, "at"), effect, dofs, signals, moved)
    design = instance_of("design", given["design"], Mapping, "a mapping", "Write {key: value}.")
    return {**found, "spin_frequency": spin, "name": given["name"], "design": dict(design)}


def _tuple_of(attribute: str, given: Any, kind: type) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise invalid(attribute, given, f"a list of {kind.__name__}", "Put it in a list.")
    items = tuple(given)
    for item in items:
        if not isinstance(item, kind):
            raise invalid(attribute, item, f"a {kind.__name__}", f"Use {kind.__name__}(...).")
    return items


def _check_names(dofs: Sequence[Dof], inputs: Sequence[Input], outputs: Sequence[Output]) -> None:
    if not dofs:
        raise invalid("dof", described("no degree of freedom"), "one or more", "Add [dof.x].")
    if not outputs:
        raise invalid("output", described("no output"), "one or more", "Add an [[output]].")
    ins, outs = [item.name for item in inputs], [item.name for item in outputs]
    for what, names in (
        ("dof", [dof.name for dof in dofs]),
        ("input", ins),
        ("output", outs),
        ("input and output", [*{*ins}, *{*outs}]),
    ):
        for name, count in Counter(names).items():
            if count > 1:
                shown, key = described(f"{count} of this name"), (what.split()[0], name)
                raise invalid(f"{what} {name!r}", shown, "one", "Rename it.", key)
    for dof in dofs:
        for taken in (f"{dof.name}_dot", f"d{dof.name}"):
            if any(other.name == taken for other in dofs):
                raise invalid(
                    ("dof", taken),
                    taken,
                    f"another name: this is what the velocity of {dof.name!r} is called",
                    "Rename it.",
                )


def _connections(what: str, key: str, items: Any, dofs: Mapping[str, Dof]) -> tuple[Any, ...]:
    checked = []
    for i, item in enumerate(items):
        pair = _pair((what, i, "between"), item.between, dofs)
        checked.append(type(item)(pair, number((what, i, key), getattr(item, key))))
    return tuple(checked)


def _coupled(items: Any, dofs: Mapping[str, Dof]) -> tuple[CoupledInertia, ...]:
    checked = []
    for i, item in enumerate(items):
        argument = ("coupled_inertia", i, "between")
        names = places(argument, item.between)
        if len(names) != 2:
            raise invalid(argument, item.between, "two coordinates", "Name the other one.")
        for name in names:
            if name == GROUND:
                remedy = "Add it to the mass of the other one."
                raise invalid(argument, name, "a coordinate: the ground does not move", remedy)
            _check_coordinate(argument, name, dofs)
        value = number(("coupled_inertia", i, "value"), item.value)
        checked.append(CoupledInertia((names[0], names[1]), value))
    return tuple(checked)


def check_inertias(
    dofs: Sequence[Dof], coupled: Sequence[CoupledInertia], moved: Collection[str]
) -> None:
    """Refuse a mass matrix of the free coordinates with which some motion has no energy.

    Parameters
    ----------
    dofs : sequence of Dof
    coupled : sequence of CoupledInertia
    moved : collection of str
        Names of the coordinates whose motion is imposed.
    """
    for dof in dofs:
        if dof.mass == 0 and dof.name not in moved:
            raise invalid(
                dof.key,
                dof.mass,
                f"a number above 0 {dof.unit}",
                "Only a coordinate with imposed motion may have none.",
            )
    free = [dof for dof in dofs if dof.name not in moved]
    names = {dof.name for dof in free}
    inside = [item for item in coupled if names.issuperset(item.between)]
    if not inside or least_energy(mass_matrix(free, inside)) > NO_ENERGY:
        return
    masses = {dof.name: dof.mass for dof in free}
    ratios = [abs(c.value) / np.sqrt(masses[c.between[0]] * masses[c.between[1]]) for c in inside]
    worst = int(np.argmax(ratios))
    item = inside[worst]
    most = float(np.sqrt(masses[item.between[0]] * masses[item.between[1]]))
    a, b = item.between
    alone = ratios[worst] >= 1
    raise invalid(
        ("coupled_inertia", coupled.index(item), "value"),
        item.value,
        f"less than {most:.6g}, the root of the product of the inertias of {a} and {b}: every "
        "motion needs a positive kinetic energy" if alone else
        "a positive kinetic energy of every motion; with the other coupled inertias some has none",
        f"Correct it, or the inertias; that of {a} contains whatever moves with it.",
    )  # fmt: skip


def _pair(argument: Key, value: Any, dofs: Mapping[str, Dof]) -> tuple[str, str]:
    """Return two ends of one kind of motion, of which the first is a coordinate."""
    names = places(argument, value)
    if len(names) != 2:
        raise invalid(argument, value, "two ends", "Add 'ground' or another coordinate.")
    first, second = names
    for name in names:
        if name not in dofs and name != GROUND:
            known = ", ".join([*dofs, GROUND])
            raise invalid(argument, name, f"one of {known}", "Check the spelling or add the dof.")
    if GROUND not in names and dofs[first].rotational != dofs[second].rotational:
        raise invalid(
            argument,
            described(f"{first!r} and {second!r}, one in m and one in rad"),
            "two coordinates of one unit",
            "Connect masses with masses and inertias with inertias.",
        )
    return first, second


def _check_coordinate(argument: Key, name: str, dofs: Mapping[str, Dof]) -> None:
    if name not in dofs:
        raise invalid(
            argument, name, f"one of {', '.join(dofs)}", "Check the spelling or add the dof."
        )


def _input(item: Input, dofs: Mapping[str, Dof]) -> Input:
    argument = ("input", item.name)
    on = places(argument, item.on)
    _check_coordinate(argument, on[0], dofs)
    on = _pair(argument, (*on, GROUND)[:2], dofs)
    imposes = item.imposes
    if imposes is not None:
        imposes = QUANTITIES.get(imposes, imposes)
        one_of((*argument, "quantity"), imposes, (DISPLACEMENT, VELOCITY, ACCELERATION))
        if on[1] != GROUND:
            raise invalid(argument, on, "one coordinate", "Impose the motion of one coordinate.")
    return Input(item.name, on, imposes, item.gain, item.unit)


def _check_imposed_motions(inputs: Sequence[Input], dofs: Mapping[str, Dof]) -> None:
    motions: dict[tuple[str, str], Input] = {}
    for item in inputs:
        if item.imposes is None:
            continue
        if (item.on[0], item.imposes) in motions:
            one, key = f"one imposed {item.imposes}", ("input", item.name, "motion_of")
            raise invalid("motion_of", item.on[0], one, "Remove the other input.", key)
        motions[item.on[0], item.imposes] = item
    for (name, quantity), item in motions.items():
        if (name, DISPLACEMENT) not in motions:
            raise invalid(
                "motion_of",
                described(f"{quantity} of {name!r} only"),
                "its displacement too",
                "Add an input for the displacement; velocity and acceleration go with it.",
                ("input", item.name, "motion_of"),
            )
    imposed = imposed_by(inputs)
    for item in inputs:
        if item.imposes is None and item.on[0] in imposed:
            raise invalid(
                ("input", item.name),
                described(f"a force on {item.on[0]!r}, whose motion is imposed"),
                "a force on a free coordinate",
                "Remove it: it changes nothing.",
            )


def _output(item: Output, dofs: Mapping[str, Dof], imposed: frozenset[str]) -> Output:
    argument = ("output", item.name)
    quantity = QUANTITIES.get(item.quantity, item.quantity)
    one_of((*argument, "quantity"), quantity, (DISPLACEMENT, VELOCITY, ACCELERATION, FORCE))
    if item.weights is not None:
        return _sum(argument, item, quantity, dofs)
    of = places(argument, item.of)
    _check_coordinate(argument, of[0] if of[0] != GROUND else of[-1], dofs)
    of = _pair(argument, (*of, GROUND)[:2], dofs)
    rotational = dofs[of[0] if of[0] != GROUND else of[1]].rotational
    if item.quantity in ROTATIONAL_ONLY and not rotational:
        raise invalid(
            (*argument, "quantity"),
            described(f"{item.quantity!r} of {of[0]!r}, which has a mass"),
            "a quantity of translation",
            f"Write quantity = {quantity!r}, or give the coordinate an inertia.",
        )
    if item.drive and (quantity != FORCE or of[0] not in imposed):
        raise invalid(
            (*argument, "of"),
            described(f"the driving force of {of[0]!r}, whose motion no input imposes"),
            "a pair of ends or an imposed coordinate",
            "Write of = ['x', 'ground'] for the force in a connection.",
        )
    return Output(item.name, of, quantity, item.drive, item.unit)


def _sum(argument: Key, item: Output, quantity: str, dofs: Mapping[str, Dof]) -> Output:
    """Check an output that sees several coordinates."""
    weights = item.weights
    fits = isinstance(weights, Sequence) and not isinstance(item.of, str)
    if not fits or not weights or len(weights) != len(item.of) or len({*item.of}) != len(item.of):
        raise invalid(
            (*argument, "weights"),
            described(f"{weights} for {item.of}"),
            "one number for each coordinate, each named once",
            "Write measures = { q1 = 0.8, q2 = -0.3 }.",
        )
    for name in item.of:
        _check_coordinate(argument, name, dofs)
    found = tuple(number((*argument, "weights"), weight) for weight in weights)
    if not any(found):
        raise invalid((*argument, "weights"), weights, "one that is not 0", "Correct them.")
    turning = {dofs[name].rotational for name in item.of}
    if quantity == FORCE or (len(turning) > 1 and item.unit is None):
        what = "a force" if quantity == FORCE else "coordinates in m and in rad"
        raise invalid(
            argument,
            described(f"a sum of {what}"),
            "a sum of motions of one kind, or with a unit of its own",
            "Give unit = 'm' if the weights convert." if quantity != FORCE else "Measure a motion.",
        )
    if item.quantity in ROTATIONAL_ONLY and turning != {True}:
        expected = "a quantity of translation"
        raise invalid((*argument, "quantity"), item.quantity, expected, f"Write {quantity!r}.")
    return Output(item.name, tuple(item.of), quantity, False, item.unit, found)


def _check_place(
    argument: Key,
    effect: Effect,
    dofs: Mapping[str, Dof],
    signals: Mapping[str, Sequence[str]],
    moved: Collection[str],
) -> None:
    kind = effect.definition
    known = signals.get(kind.domain, [*dofs, GROUND])
    for name in effect.at:
        if name not in known:
            listed = ", ".join(known) or f"the {kind.domain}s, of which there are none"
            raise invalid(argument, name, f"one of {listed}", f"{kind.title} acts there.")
    for name, unit in kind.channels:
        if name not in moved:
            raise invalid(
                argument,
                described(f"an effect that reads {name!r}, which no input imposes"),
                f"a coordinate {name} with an input in {unit}",
                f"Add it with model.with_channel({name!r}, {unit!r}).",
            )
    turning = {dofs[name].rotational for name in effect.at if name in dofs}
    if kind.domain == "pair" and len(turning) > 1:
        raise invalid(
            argument, effect.at, "two coordinates of one unit", "Do not mix masses and inertias."
        )
