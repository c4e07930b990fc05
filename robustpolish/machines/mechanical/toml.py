"""Mechanical models as TOML files."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from robustpolish.base.atomic_writes import write_file
from robustpolish.base.checks import (
    Key,
    described,
    inside,
    instance_of,
    invalid,
    known_keys,
    misfit,
)
from robustpolish.base.input_files import FileSpec, check_tree
from robustpolish.base.input_files import text as read_text
from robustpolish.base.versions import __version__
from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.formula_language import OWN_KEYS
from robustpolish.machines.effects.kind import GROUND
from robustpolish.machines.effects.user_defined import own_kind, own_table
from robustpolish.machines.mechanical.data import MechanicalData
from robustpolish.machines.mechanical.equations import Equations
from robustpolish.machines.mechanical.feedback import (
    Feedback,
    FeedbackTerm,
    feedback_from_file,
)
from robustpolish.machines.mechanical.parts import (
    CONNECTIONS,
    DISPLACEMENT,
    FORCE,
    Dof,
    Input,
    Output,
    Ratio,
    number,
    quantity_of,
)

# Where in a TOML text a key stands, so that a message can say so.
#
# `tomllib` gives values without positions. The keys of our errors, such as
# ``("spring", 1, "stiffness")`` or ``("input", "F_x", "gain")``, are enough to find the line.

_KEY = r"""\"[^\"]*\"|'[^']*'|[^\s.\"'\[\]=#{}]+"""
_LINE = re.compile(rf"\s*(\[\[?)?(\s*(?:{_KEY})(?:\s*\.\s*(?:{_KEY}))*)\s*[\]=]\s*({_KEY})?")
"""A header or the line of a key: the brackets, the dotted key, and the first word of the value."""


def line_of(text: str, key: Key) -> int | None:
    r"""Return the line, counted from 1, on which a key stands.

    Parameters
    ----------
    text : str
        The TOML file.
    key : tuple of str or int
        As in `InvalidInputError.key`: the table, the name or number of its entry, then the way
        inside it.

    Returns
    -------
    int or None
        The line of the key, of its table if the key cannot be found, or None.

    Examples
    --------
    >>> line_of("[dof.x]\nmass = -1", ("dof", "x", "mass"))
    2
    """
    lines: dict[Key, int] = {}
    entries: Counter[Key] = Counter()
    named: dict[Key, Key] = {}
    table: Key = ()
    for i, line in enumerate(text.splitlines(), 1):
        if (found := _LINE.match(line)) is None:
            continue
        brackets, dotted, value = found.groups()
        parts: tuple[str, ...] = tuple(part.strip("\"'") for part in re.findall(_KEY, dotted))
        if brackets:
            table = ()
            for depth, part in enumerate(parts, 1):
                table = (*table, part)
                entries[table] += brackets == "[[" and depth == len(parts)
                if entries[table]:
                    table = (*table, entries[table] - 1)
        elif parts == ("name",) and value:  # of two with one name the later one is too many
            named[*table[:1], value.strip("\"'")] = table
        here = table if brackets else (*table, *parts)
        for length in range(1, len(here) + 1):
            lines.setdefault(here[:length], i)
    way = (*named.get(key[:2], key[:2]), *key[2:])
    single = tuple(part for part in way if isinstance(part, str))  # one table instead of a list
    parts_of = [each[:length] for each in (way, single) for length in range(len(each), 0, -1)]
    for each in sorted(parts_of, key=lambda part: -sum(isinstance(p, str) for p in part)):
        if each in lines:
            return lines[each]
    return next((i for path, i in lines.items() if key and key[0] in path), None)


Table = Mapping[str, Any]

_READY = Path(__file__).parents[1] / "ready"
_MATRICES = ("A", "B", "C", "D")

_FILE = FileSpec(
    "model", "a TOML file with a mechanical model", "Check the path and the file.", 10_000_000
)

_TOP = (
    "name", "spin_frequency", "dof", *CONNECTIONS, "input", "output", "effect", "feedback",
    "design", "weights", "equation", "parameter", "start",
)  # fmt: skip


def read_model(source: str | Path, max_bytes: float | None = None) -> MechanicalData:
    """Read a model from a file, from TOML text if `source` has a line break, or by its name."""
    ready = _READY / f"{source}.toml"
    named = isinstance(source, str | Path) and str(source).isidentifier()
    if named and not Path(source).exists() and ready.is_file():
        source = ready
    text_given = isinstance(source, str) and "\n" in source
    with toml_with_line_numbers(source, max_bytes) as table:
        return _model(table, Path() if text_given else Path(source).parent)


@contextmanager
def toml_with_line_numbers(source: str | Path, max_bytes: float | None = None) -> Iterator[Table]:
    """Read a TOML file, or text; what is complained about inside gets the number of its line.

    Parameters
    ----------
    source : path or str
        A file, or TOML text if it has a line break.
    max_bytes : float, optional
        Largest size of a file.

    Yields
    ------
    mapping
        The tables.
    """
    if isinstance(source, str) and "\n" in source:
        content, where = source, "model"
    else:
        content, where = read_text(source, _FILE.limited(max_bytes)), str(source)
    try:
        table = tomllib.loads(content)
    except tomllib.TOMLDecodeError as error:
        raise InvalidInputError(f"{where}: not valid TOML: {error}.") from None
    except ValueError:  # Python reads no integers of thousands of digits
        what = "an integer of thousands of digits"
        raise InvalidInputError(f"{where}: not a model: {what}.") from None
    except RecursionError:
        raise InvalidInputError(f"{where}: not a model: tables nested too deeply.") from None
    try:
        check_tree(table)
        yield table
    except InvalidInputError as error:
        line = line_of(content, error.key)
        at = f"{where}, line {line}" if line else where
        raise InvalidInputError(f"{at}: {error}", error.key) from None


def _model(table: Table, folder: Path) -> MechanicalData:
    needed = () if "equation" in table else ("dof",)
    known_keys((), table, _TOP, required=(*needed, "output"))
    dofs = [_dof(name, item) for name, item in _table(("dof",), table.get("dof", {})).items()]
    return MechanicalData(
        dofs=tuple(dofs),
        equations=_equations(table),
        **{f"{what}s": _list(table, what, _connection) for what in CONNECTIONS},
        inputs=_list(table, "input", lambda where, item: _input(where, item, dofs, table)),
        outputs=_list(table, "output", _output),
        effects=_list(table, "effect", _effect),
        spin_frequency=table.get("spin_frequency"),
        name=table.get("name", ""),
        design=design_section(table),
        feedback=_list(table, "feedback", lambda where, item: _feedback(where, item, folder)),
    )


def design_section(table: Table) -> dict[str, Any]:
    """Return the sections [design] and [weights] of a file, the latter as a key of the former.

    They say what is asked of a controller; here nobody reads them, a file that is written anew has
    them again.
    """
    design, weights = (_table((key,), table.get(key, {})) for key in ("design", "weights"))
    if weights and "weights" in design:
        shown = described("weights of a [design] that has its own")
        raise invalid("weights", shown, "one table of weights", "Join them.")
    section = {**design, "weights": weights} if weights else dict(design)
    _check_kept(("design",), section)
    return section


def _check_kept(where: Key, value: Any) -> None:
    """Refuse values of a section that could not be written again, such as dates."""
    if isinstance(value, dict | list):
        inside = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in inside:
            _check_kept((*where, key), item)
    elif not isinstance(value, str | bool | int | float):
        raise invalid(where, str(value), "a number, text or true or false", "Correct it.")


def _table(where: Key, value: Any) -> Table:
    if not isinstance(value, dict):
        entry = isinstance(where[-1], int)
        header = f"[[{where[0]}]]" if entry else f"[{'.'.join(map(str, where))}]"
        raise invalid(where, value, "a table", f"Write {header} and its keys below.")
    return value


def _list(table: Table, key: str, make: Callable[[Key, Table], Any]) -> tuple[Any, ...]:
    items = table.get(key, [])
    items = [items] if key == "feedback" and isinstance(items, dict) else items
    if not isinstance(items, list):
        raise misfit(key, "a single table", f"[[{key}]]", "Write two brackets: it is a list.")
    return tuple(make((key, i), _table((key, i), item)) for i, item in enumerate(items))


def _dof(name: str, item: Any) -> Dof:
    where = ("dof", name)
    item = _table(where, item)
    known_keys(where, item, ("mass", "inertia", "axis"))
    given = [key for key in ("mass", "inertia") if key in item]
    if len(given) != 1:
        shown = described(" and ".join(given) or "neither")
        raise invalid(where, shown, "either mass or inertia", "Give one of them.")
    return Dof(name, item[given[0]], given[0] == "inertia", item.get("axis", ""))


def _equations(table: Table) -> tuple[Equations, ...]:
    """Return the equations of motion of a file."""
    given: dict[str, dict[str, Any]] = {"coordinates": {}, "states": {}, "law": {}, "inputs": {}}
    for i, item in enumerate(_list(table, "equation", lambda _, item: item)):
        where = ("equation", i)
        known_keys(where, item, ("of", "unit", "formula"), ("of", "unit", "formula"))
        name, text = item["of"], instance_of((*where, "formula"), item["formula"], str, "text", "")
        if name in given["law"]:
            raise invalid((*where, "of"), name, "one equation of each", "Put the two together.")
        second = re.search(rf"\b{re.escape(str(name))}_ddot\b", text) or name in table.get(
            "dof", {}
        )
        given["coordinates" if second else "states"][name] = item["unit"]
        given["law"][name] = text
    numbers = _table(("parameter",), table.get("parameter", {}))
    start = _table(("start",), table.get("start", {}))
    if not given["law"]:
        for key in ("parameter", "start"):
            if key in table:
                shown = described(f"[{key}] without an [[equation]]")
                raise invalid(key, shown, "equations that have it", "Add one, or remove it.")
        return ()
    for i, item in enumerate(table.get("input", ())):
        if isinstance(item, dict) and not {"force_on", "torque_on", "motion_of"} & {*item}:
            known_keys(("input", i), item, ("name", "unit", "gain"), ("name", "unit"))
            given["inputs"][item["name"]] = item["unit"]
    parameters, known = {}, []
    for name, item in numbers.items():
        where = ("parameter", name)
        known_keys(where, _table(where, item), ("value", "unit", "known"), ("value", "unit"))
        parameters[name] = (item["value"], item["unit"])
        known += [name] * bool(item.get("known"))
    try:
        return (Equations(parameters=parameters, start=start, known=tuple(known), **given),)
    except InvalidInputError as error:  # keys of a file
        what, *name = error.key or ("law",)
        rows = [item["of"] for item in table["equation"]]
        if what in ("law", "coordinates", "states") and name and name[0] in rows:
            raise InvalidInputError(str(error), ("equation", rows.index(name[0]))) from None
        where = {"parameters": "parameter", "inputs": "input"}.get(str(what), str(what))
        raise InvalidInputError(str(error), (where, *name)) from None


def _connection(where: Key, item: Table) -> Any:
    kind, name, _ = CONNECTIONS[str(where[0])]
    if kind is Ratio and "lead" in item:  # of a screw, in m per turn
        known_keys(where, item, ("between", "lead"))
        return Ratio(item["between"], number((*where, "lead"), item["lead"]) / (2 * math.pi))
    known_keys(where, item, ("between", name), ("between", name))
    return kind(item["between"], item[name])


def _input(where: Key, item: Table, dofs: list[Dof], table: Table) -> Input:
    places = ("force_on", "torque_on", "motion_of")
    if not {*places} & {*item} and table.get("equation"):  # which equations read
        first = table["equation"][0].get("of")
        return Input(item["name"], (first, GROUND), None, item.get("gain", 1.0), item.get("unit"))
    known_keys(where, item, ("name", *places, "gain", "quantity", "unit"), ("name",))
    given = [key for key in places if key in item]
    if len(given) != 1:
        shown = described(" and ".join(given) or "none of them")
        raise invalid(where, shown, "one of force_on, torque_on and motion_of", "Give one of them.")
    key, place, imposes = given[0], item[given[0]], None
    if key == "motion_of":
        imposes = item.get("quantity", DISPLACEMENT)
    elif "quantity" in item:
        want = f"no quantity with {key}"
        raise invalid((*where, "quantity"), item["quantity"], want, "Remove it.")
    ends = place if isinstance(place, list) else [place]
    turning = {dof.rotational for dof in dofs if dof.name in ends}  # both where a ratio joins them
    for dof in dofs:
        if imposes is None and dof.name in ends[:1] and (key == "torque_on") not in turning:
            wanted = "torque_on" if dof.rotational else "force_on"
            has = "an inertia in kg m^2" if dof.rotational else "a mass in kg"
            shown, want = described(f"{key} = {dof.name!r}, which has {has}"), f"{wanted} there"
            raise invalid((*where, key), shown, f"{want}: units must match", f"Write {wanted}.")
    on: Any = place
    return Input(item["name"], on, imposes, item.get("gain", 1.0), item.get("unit"))


def _output(where: Key, item: Table) -> Output:
    quantity = item.get("quantity", DISPLACEMENT)
    measures: Any = item.get("measures")
    force = quantity_of(where, quantity) == FORCE
    keys = ("of",) if force else ("measures",)
    more = () if force or isinstance(measures, dict) else ("relative_to",)
    known_keys(where, item, ("name", *keys, "quantity", *more, "unit"), ("name", *keys))
    name, unit = item["name"], item.get("unit")
    if force:
        of = item["of"]
        remedy = "Write of = 'F', or of = ['x', 'ground']."
        instance_of((*where, "of"), of, (str, list), "the name of an input, or two places", remedy)
        return Output(name, of, quantity, isinstance(of, str) or len(of) == 1, unit)
    if isinstance(measures, dict):
        return Output(name, tuple(measures), quantity, unit=unit, weights=tuple(measures.values()))
    return Output(name, (measures, item.get("relative_to", GROUND)), quantity, unit=unit)


def _effect(where: Key, item: Table) -> Effect:
    formula = "formula" in item
    what = OWN_KEYS if formula else ("kind",)
    known_keys(where, item, (*what, "at", "parameters"), (what[0], "at"))
    at = item["at"]
    if not isinstance(at, str | list) or not at:
        raise invalid((*where, "at"), at, "a list of names", "Write at = ['x', 'ground'].")
    if not formula and not isinstance(item["kind"], str):
        raise invalid((*where, "kind"), item["kind"], "a name", "Write it as text.")
    place = (at,) if isinstance(at, str) else tuple(at)
    numbers = item.get("parameters", {})
    try:
        if formula:
            kind = own_kind({key: item[key] for key in OWN_KEYS if key in item})
            return Effect.of(kind, place, numbers)
        return Effect(item["kind"], place, numbers)
    except InvalidInputError as error:  # says where in the file; its key began with the kind
        inside = error.key if formula and error.key[0] in OWN_KEYS else error.key[1:]
        message = f"effect[{where[1]}]: {error}"
        raise InvalidInputError(message, (*where, *inside)) from None


def _feedback(where: Key, item: Table, folder: Path) -> Feedback:
    saved = ("controller", "references")
    own = [each.name for each in fields(Feedback) if each.name not in ("terms", "matrices")]
    known_keys(where, item, (*own, "term", *_MATRICES, *saved))
    given: dict[str, Any] = {key: item[key] for key in own if key in item}
    with inside(where):
        if "controller" in item:
            known_keys((), item, (*own, *saved))
            references = _table((*where, "references"), item.get("references", {}))
            path = instance_of("controller", item["controller"], str, "a file", "Write its name.")
            path = folder / path
            return feedback_from_file(path, references, **given)
        known_keys((), item, (*own, "term", *_MATRICES), ("drives",))
        keys, terms = [each.name for each in fields(FeedbackTerm)], []
        for k, term in enumerate(item.get("term", ())):
            known_keys(("term", k), _table(("term", k), term), keys, ("of",))
            terms.append(FeedbackTerm(**term))
        if any(name in item for name in _MATRICES):
            known_keys((), item, item, _MATRICES)
            given["matrices"] = tuple(item[name] for name in _MATRICES)
        return Feedback(**{"period": None, **given, "terms": terms})


def _feedback_table(loop: Feedback) -> dict[str, Any]:
    def told(part: Any, left_out: Sequence[str]) -> dict[str, Any]:
        each = ((f, getattr(part, f.name)) for f in fields(part) if f.name not in left_out)
        return {f.name: value for f, value in each if value != f.default}

    table = told(loop, ("terms", "matrices"))
    if loop.matrices is not None:
        table |= dict(zip(_MATRICES, loop.matrices, strict=True))
    return {**table, "term": [told(term, ()) for term in loop.terms]}


def write_model(model: MechanicalData, path: str | Path | None = None) -> str:
    """Return `model` as TOML text; write it to `path` whole or not at all."""
    lines: list[str] = [f"# A mechanical model of robustpolish {__version__}", ""]
    if model.name:
        lines.append(f"name = {_value(model.name)}")
    if model.spin_frequency is not None:
        lines.append(f"spin_frequency = {_value(model.spin_frequency)}  # Hz")
    for item in model.equations:
        lines += _equation_lines(item)
    own = {name for item in model.equations for name in item.coordinates}
    for dof in model.dofs:
        if dof.name in own and not dof.mass:
            continue
        lines += ["", f"[dof.{_key(dof.name)}]"]
        lines.append(f"{dof.key[-1]} = {_value(dof.mass)}  # {dof.unit}")
        lines += [f"axis = {_value(dof.axis)}"] * bool(dof.axis)
    for what, (_, name, _) in CONNECTIONS.items():
        for part in getattr(model, f"{what}s"):
            lines += _entry(what, {"between": part.between, name: getattr(part, name)})
    for source in model.inputs:
        lines += _entry("input", _input_table(model, source))
    for output in model.outputs:
        lines += _entry("output", _output_table(output))
    for effect in model.effects:
        what = own_table(effect.definition) or {"kind": effect.kind}
        table = {**what, "at": effect.at, "parameters": dict(effect.parameters)}
        lines += _entry("effect", table)
    for loop in model.feedback:
        lines += _entry("feedback", _feedback_table(loop))
    lines += _section("design", model.design)
    text = "\n".join(lines).lstrip("\n") + "\n"
    if path is not None:
        write_file(path, text, force=True)
    return text


def _equation_lines(item: Equations) -> list[str]:
    if callable(item.law):
        shown = described("equations of motion that are a Python function")
        remedy = "Write them as formulas, or keep the script that makes the model."
        raise invalid("equations", shown, "formulas", remedy)
    lines: list[str] = []
    for name, text in item.law.items():
        unit = {**item.coordinates, **item.states}[name]
        lines += _entry("equation", {"of": name, "unit": unit, "formula": text})
    known = {True: {"known": True}, False: {}}
    numbers = {
        name: {"value": value, "unit": unit, **known[name in item.known]}
        for name, (value, unit) in item.parameters.items()
    }
    return lines + _section("parameter", numbers) + _section("start", item.start)


def _input_table(model: MechanicalData, item: Input) -> dict[str, Any]:
    if any(item.name in equations.inputs for equations in model.equations):
        table = {"name": item.name, "unit": item.unit, "gain": item.gain}
        return {k: v for k, v in table.items() if (k, v) != ("gain", 1.0)}
    force = "torque_on" if model.is_rotational(item.on) else "force_on"
    table = {
        "name": item.name,
        "motion_of" if item.imposes else force: item.on[0] if item.on[1] == GROUND else item.on,
        "quantity": item.imposes,
        "gain": item.gain,
        "unit": item.unit,
    }
    left_out = {"quantity": DISPLACEMENT, "gain": 1.0}
    return {k: v for k, v in table.items() if v is not None and v != left_out.get(k)}


def _output_table(item: Output) -> dict[str, Any]:
    table: dict[str, Any] = {"name": item.name}
    if item.quantity == FORCE:
        table |= {"quantity": FORCE, "of": item.of[0] if item.drive else item.of}
    else:
        weighted = item.weights and dict(zip(item.of, item.weights, strict=True))
        table |= {"measures": weighted or item.of[0], "quantity": item.quantity}
        if not weighted and item.of[1] != GROUND:
            table["relative_to"] = item.of[1]
    return table | ({} if item.unit is None else {"unit": item.unit})


def _entry(name: str, table: Mapping[str, Any]) -> list[str]:
    return ["", f"[[{name}]]", *(f"{_key(key)} = {_value(value)}" for key, value in table.items())]


def _section(name: str, table: Mapping[str, Any]) -> list[str]:
    """Write a table, and below it those of its tables that hold tables in turn."""
    if not table:
        return []
    deep = {
        key: value
        for key, value in table.items()
        if isinstance(value, Mapping) and any(isinstance(v, Mapping) for v in value.values())
    }
    flat = {key: value for key, value in table.items() if key not in deep}
    lines = ["", f"[{name}]", *(f"{_key(key)} = {_value(value)}" for key, value in flat.items())]
    for key, value in deep.items():
        lines += _section(f"{name}.{_key(key)}", value)
    return lines


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, str):
        # JSON and TOML escape alike, but for DEL, which TOML wants escaped too.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value if isinstance(value, int) else float(value))
