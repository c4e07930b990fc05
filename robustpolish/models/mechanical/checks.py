"""Checks that concern a mechanical model as a whole, not one part of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from robustpolish.effects import GROUND, Effect
from robustpolish.models.mechanical.parts import (
    ACCELERATION,
    DISPLACEMENT,
    FORCE,
    QUANTITIES,
    ROTATIONAL_ONLY,
    VELOCITY,
    Damper,
    Dof,
    Input,
    Output,
    Spring,
    number,
    places,
)
from robustpolish.validation import described, invalid, one_of, positive

if TYPE_CHECKING:
    from robustpolish.models.mechanical import MechanicalModel


def check_model(model: MechanicalModel) -> None:
    """Check a model while it is made, and turn its lists into tuples."""
    _tuples(model)
    if not model.dofs:
        raise invalid("dof", described("no degree of freedom"), "one or more", "Add [dof.x].")
    if not model.outputs:
        raise invalid("output", described("no output"), "one or more", "Add an [[output]].")
    for what, names in (
        ("dof", [dof.name for dof in model.dofs]),
        ("input", [item.name for item in model.inputs]),
        ("output", [item.name for item in model.outputs]),
        ("input and output", [*{i.name for i in model.inputs}, *{o.name for o in model.outputs}]),
    ):
        for name, count in Counter(names).items():
            if count > 1:
                raise invalid(
                    f"{what} {name!r}", described(f"{count} of this name"), "one", "Rename it."
                )
    for dof in model.dofs:
        for taken in (f"{dof.name}_dot", f"d{dof.name}"):
            if any(other.name == taken for other in model.dofs):
                raise invalid(
                    f"dof.{taken}",
                    taken,
                    f"another name: this is what the velocity of {dof.name!r} is called",
                    "Rename it.",
                )
    if model.spin_frequency is not None:
        spin = positive("spin_frequency", number("spin_frequency", model.spin_frequency), "Hz")
        object.__setattr__(model, "spin_frequency", spin)
    if not isinstance(model.name, str):
        raise invalid("name", model.name, "text", "Write it between quotation marks.")
    dofs = {dof.name: dof for dof in model.dofs}
    object.__setattr__(model, "springs", _connections("spring", "stiffness", model.springs, dofs))
    object.__setattr__(model, "dampers", _connections("damper", "damping", model.dampers, dofs))
    object.__setattr__(model, "inputs", tuple(_input(item, dofs) for item in model.inputs))
    _imposed_motions(model, dofs)
    object.__setattr__(
        model, "outputs", tuple(_output(item, model, dofs) for item in model.outputs)
    )
    for i, effect in enumerate(model.effects):
        _effect_place(f"effect[{i}].at", effect, model)


def _tuples(model: MechanicalModel) -> None:
    kinds: dict[str, type] = {
        "dofs": Dof,
        "springs": Spring,
        "dampers": Damper,
        "inputs": Input,
        "outputs": Output,
        "effects": Effect,
    }
    for attribute, kind in kinds.items():
        given = getattr(model, attribute)
        if isinstance(given, str) or not isinstance(given, Iterable):
            raise invalid(attribute, given, f"a list of {kind.__name__}", "Put it in a list.")
        items = tuple(given)
        for item in items:
            if not isinstance(item, kind):
                raise invalid(attribute, item, f"a {kind.__name__}", f"Use {kind.__name__}(...).")
        object.__setattr__(model, attribute, items)


def _connections(what: str, key: str, items: Any, dofs: dict[str, Dof]) -> tuple[Any, ...]:
    checked = []
    for i, item in enumerate(items):
        pair = _pair(f"{what}[{i}].between", item.between, dofs)
        checked.append(type(item)(pair, number(f"{what}[{i}].{key}", getattr(item, key))))
    return tuple(checked)


def _pair(argument: str, value: Any, dofs: dict[str, Dof]) -> tuple[str, str]:
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


def _coordinate(argument: str, name: str, dofs: dict[str, Dof]) -> Dof:
    if name not in dofs:
        raise invalid(
            argument, name, f"one of {', '.join(dofs)}", "Check the spelling or add the dof."
        )
    return dofs[name]


def _input(item: Input, dofs: dict[str, Dof]) -> Input:
    argument = f"input.{item.name}"
    on = places(argument, item.on)
    _coordinate(argument, on[0], dofs)
    on = _pair(argument, (*on, GROUND)[:2], dofs)
    imposes = item.imposes
    if imposes is not None:
        imposes = QUANTITIES.get(imposes, imposes)
        one_of(f"{argument}.quantity", imposes, (DISPLACEMENT, VELOCITY, ACCELERATION))
        if on[1] != GROUND:
            raise invalid(argument, on, "one coordinate", "Impose the motion of one coordinate.")
    return Input(item.name, on, imposes, item.gain, item.unit)


def _imposed_motions(model: MechanicalModel, dofs: dict[str, Dof]) -> None:
    motions = Counter((item.on[0], item.imposes) for item in model.inputs if item.imposes)
    for (name, quantity), count in motions.items():
        if count > 1:
            raise invalid("motion_of", name, f"one imposed {quantity}", "Remove the other input.")
        if (name, DISPLACEMENT) not in motions:
            raise invalid(
                "motion_of",
                described(f"{quantity} of {name!r} only"),
                "its displacement too",
                "Add an input for the displacement; velocity and acceleration go with it.",
            )
    imposed = set(model.imposed)
    for dof in dofs.values():
        if dof.mass == 0 and dof.name not in imposed:
            key = "inertia" if dof.rotational else "mass"
            raise invalid(
                f"dof.{dof.name}.{key}",
                dof.mass,
                f"a number above 0 {dof.unit}",
                "Only a coordinate with imposed motion may have none.",
            )
    for item in model.inputs:
        if item.imposes is None and item.on[0] in imposed:
            raise invalid(
                f"input.{item.name}",
                described(f"a force on {item.on[0]!r}, whose motion is imposed"),
                "a force on a free coordinate",
                "Remove it: it changes nothing.",
            )


def _output(item: Output, model: MechanicalModel, dofs: dict[str, Dof]) -> Output:
    argument = f"output.{item.name}"
    quantity = QUANTITIES.get(item.quantity, item.quantity)
    one_of(f"{argument}.quantity", quantity, (DISPLACEMENT, VELOCITY, ACCELERATION, FORCE))
    of = places(argument, item.of)
    _coordinate(argument, of[0] if of[0] != GROUND else of[-1], dofs)
    of = _pair(argument, (*of, GROUND)[:2], dofs)
    rotational = dofs[of[0] if of[0] != GROUND else of[1]].rotational
    if item.quantity in ROTATIONAL_ONLY and not rotational:
        raise invalid(
            f"{argument}.quantity",
            described(f"{item.quantity!r} of {of[0]!r}, which has a mass"),
            "a quantity of translation",
            f"Write quantity = {quantity!r}, or give the coordinate an inertia.",
        )
    if item.drive and (quantity != FORCE or of[0] not in model.imposed):
        raise invalid(
            f"{argument}.of",
            described(f"the driving force of {of[0]!r}, whose motion no input imposes"),
            "a pair of ends or an imposed coordinate",
            "Write of = ['x', 'ground'] for the force in a connection.",
        )
    return Output(item.name, of, quantity, item.drive, item.unit)


def _effect_place(argument: str, effect: Effect, model: MechanicalModel) -> None:
    kind = effect.definition
    known = {"input": model.input_names, "output": model.output_names}.get(
        kind.domain, (*model.dof_names, GROUND)
    )
    for name in effect.at:
        if name not in known:
            listed = ", ".join(known) or f"the {kind.domain}s, of which there are none"
            raise invalid(argument, name, f"one of {listed}", f"{kind.title} acts there.")
    turning = {model.dof(name).rotational for name in effect.at if name in model.dof_names}
    if kind.domain == "pair" and len(turning) > 1:
        raise invalid(
            argument, effect.at, "two coordinates of one unit", "Do not mix masses and inertias."
        )
