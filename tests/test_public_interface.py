"""Every public name says what it takes, takes nothing else, and has an example that runs."""

import doctest
import enum
import importlib
import inspect
import json
import re
from pathlib import Path

import pytest

import robustpolish as rp
from robustpolish.base.results import Displayed
from robustpolish.names import NAMESPACES

# What python-control, xarray or the language would document: their parameters are not ours.
INHERITED = (dict, tuple, Exception, enum.Enum)


def public_names():
    """Yield (name, object) for what robustpolish and its namespaces offer, each object once."""
    seen = set()
    for room in ("robustpolish", *(f"robustpolish.{name}" for name in NAMESPACES)):
        module = importlib.import_module(room)
        for name in getattr(module, "__all__", None) or [n for n in vars(module) if n[0] != "_"]:
            found = getattr(module, name)
            ours = getattr(found, "__module__", "").startswith("robustpolish")
            if ours and callable(found) and id(found) not in seen:
                seen.add(id(found))
                yield f"{room}.{name}", found


def methods(cls):
    """Yield (name, function) for the public methods that a class defines itself."""
    for name, member in vars(cls).items():
        function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        own = inspect.isfunction(function) and name not in getattr(cls, "__dataclass_fields__", {})
        if own and not name.startswith("_"):
            yield name, function


def functions():
    for name, found in public_names():
        if inspect.isclass(found):
            yield from ((f"{name}.{method}", function) for method, function in methods(found))
        elif inspect.isfunction(found):
            yield name, found


FUNCTIONS = dict(functions())
CLASSES = {n: c for n, c in public_names() if inspect.isclass(c) and not issubclass(c, INHERITED)}


def documented(docstring, sections=("Parameters",)):
    """Return the names that numpydoc sections list, with the stars of *args and **kwargs."""
    names = []
    for section in sections:
        found = re.search(rf"^{section}\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", docstring, re.S | re.M)
        for line in found[1].splitlines() if found else ():
            if line and not line.startswith(" "):
                names += [name.strip() for name in line.split(" : ")[0].split(",")]
    return names


@pytest.mark.parametrize("name", FUNCTIONS)
def test_parameters_are_documented(name):
    function = FUNCTIONS[name]
    docstring = inspect.getdoc(function) or ""
    assert docstring, f"{name} has no docstring"
    parameters = [
        parameter
        for parameter in inspect.signature(function).parameters.values()
        # What starts with an underscore is for the package and its tests.
        if parameter.name not in ("self", "cls") and parameter.name[0] != "_"
    ]
    swallowed = [p.name for p in parameters if p.kind is p.VAR_KEYWORD]
    assert not swallowed or name in FORWARDED, f"{name} swallows keywords"
    stars = {"VAR_POSITIONAL": "*", "VAR_KEYWORD": "**"}
    taken = [stars.get(p.kind.name, "") + p.name for p in parameters]
    assert sorted(documented(docstring)) == sorted(taken)


# Keywords that name fields or parameters of another object, which refuses what it does not know.
FORWARDED = (
    "robustpolish.polishing.BrushParameters.for_run",
    "robustpolish.GeneralizedPlant.replace",
    "robustpolish.design_machine",
    "robustpolish.look",
    "robustpolish.read_design_task",
    "robustpolish.effects.Effect.with_parameters",
    "robustpolish.trade_off",
)


@pytest.mark.parametrize("name", CLASSES)
def test_fields_are_documented(name):
    docstring = inspect.getdoc(CLASSES[name]) or ""
    fields = list(getattr(CLASSES[name], "__dataclass_fields__", {}))
    listed = documented(docstring, ("Parameters", "Attributes"))
    assert docstring
    assert [field for field in fields if field not in listed and field[0] != "_"] == []
    known = {*fields, *dir(CLASSES[name]), *inspect.signature(CLASSES[name]).parameters}
    assert [item for item in listed if item not in known] == []


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES])
def test_unknown_keywords_are_refused(name):
    called = FUNCTIONS.get(name) or CLASSES[name]
    if name in FORWARDED:
        return
    signature = inspect.signature(called)
    with pytest.raises(TypeError, match="unexpected keyword"):
        signature.bind_partial(no_such_keyword=1)


def test_forwarded_keywords_are_refused_too():
    with pytest.raises(TypeError, match="no_such_keyword"):
        rp.polishing.BrushParameters.for_run(1, no_such_keyword=1)
    with pytest.raises(TypeError, match="no_such_keyword"):
        rp.air_bearing().replace(no_such_keyword=1)
    with pytest.raises(TypeError, match="no_such_keyword"):
        rp.trade_off(rp.air_bearing(), [1.0], no_such_keyword=1)
    with pytest.raises(TypeError, match="no_such_keyword"):
        rp.look("run.csv", no_such_keyword=1)
    for forwarding in (rp.design_machine, rp.read_design_task):
        with pytest.raises(rp.InvalidInputError, match="no_such_keyword"):
            forwarding(rp.air_bearing(), no_such_keyword=1)
    effect = importlib.import_module("robustpolish.effects").Effect("cubic_stiffness", ("x",))
    with pytest.raises(rp.InvalidInputError, match="no_such_keyword"):
        effect.with_parameters(no_such_keyword=1)


ANSWERS = Path(__file__).parent / "reference" / "answers"
ONCE_AT_THE_TOP = json.loads((ANSWERS / "signatures.json").read_text())["names"]


def with_examples():
    """Yield the names at the top, now or in version 0.1.0, and the methods of their classes."""
    for name, found in public_names():
        room, _, name = name.rpartition(".")
        if room != "robustpolish" and name not in ONCE_AT_THE_TOP:
            continue
        if inspect.isclass(found) and issubclass(found, Exception):
            continue
        yield name, found
        if inspect.isclass(found):
            yield from ((f"{name}.{method}", function) for method, function in methods(found))


EXAMPLES = dict(with_examples())


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_public_name_has_an_example(name):
    # That the examples run is the doctests' part. A class may show its methods in one example.
    owner, _, method = name.partition(".")
    shown = examples(owner) if f".{method}(" in examples(owner) and method else examples(name)
    assert shown, f"{name} has no example"


def examples(name):
    found = doctest.DocTestFinder(recurse=False).find(EXAMPLES[name], name)
    return "".join(example.source for test in found for example in test.examples)


RESULTS = [n for n, c in CLASSES.items() if issubclass(c, Displayed)]
NO_PICTURE = (
    "SectorStability",
    "GeneralizedPlant",
    "AirBearingParameters",
    "PolishingHardware",
    "MechanicalModel",
    "RotorModel",
    "LmiCheck",
    "DesignTask",
    "UncertainSystem",
    "DelayedSystem",
    "Ellipsoid",
)


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_draws_itself(name):
    if name.rsplit(".", 1)[-1] in NO_PICTURE:
        return
    first, *rest = list(inspect.signature(CLASSES[name].plot).parameters.values())[1:]
    assert (first.name, first.default) == ("ax", None)
    assert all(p.kind is p.KEYWORD_ONLY for p in rest)


@pytest.mark.parametrize(
    "value",
    [
        rp.Dof("x", 2.0),
        rp.Spring(("x", "ground"), 3000.0),
        rp.Damper(("x", "y"), 3.0),
        rp.machines.CoupledInertia(("x", "y"), 0.1),
        rp.Ratio(("x", "phi"), 0.02),
        rp.Input("F", ("x", "ground")),
        rp.Output("x", ("x", "ground")),
        rp.simulation.DelayLine("x", 1e-3),
        rp.HalfPlane(-1.0),
        rp.Disk(-2.0, 1.0),
        rp.Sector(0.3),
        rp.polishing.Surface(0.1, 2.5),
        rp.polishing.BrushParameters.for_run(3, spin=200.0),
        rp.LoopRequirements(modulus=0.6),
        rp.polishing.PolishingAxis(),
        rp.rotor.ShaftSegment(0.1, 0.02),
        rp.rotor.RotorDisc(0.05, 1.0, 1e-3, 2e-3),
        rp.rotor.RotorBearing(0.0, 1e6),
        rp.results.PassiveElement("spring", ("x", "ground"), 5.0, "N/m"),
        rp.tunable.tunable("k", 10.0, low=0.0, high=1e4),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_typed_can_be_copied_from_the_screen(value):
    names = {name.rpartition(".")[2]: found for name, found in public_names()}
    assert eval(repr(value), names) == value
