"""Mechanical models in TOML files: read, written, refused with the line."""

import re
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import kinds
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.machine_files import machine

FILE = machine("axis")
ROTATION = machine("rotation")
RIG = machine("rig")
OWN = machine("own_effects")


def test_the_documented_file():
    model = MechanicalModel.from_toml(FILE)
    assert model.name == "air bearing, x axis"
    assert model.spin_frequency == 50.0
    assert model.dofs == (Dof("x_m", 0.6376), Dof("x", 0.2))
    assert model.springs[1] == Spring(("x_m", "x"), 2.9821e5)
    assert model.dampers == (Damper(("x_m", "ground"), 13.16),)
    assert model.inputs == (Input("F_x", ("x", "ground")),)
    assert model.outputs == (Output("x", ("x", "ground")),)
    assert model.effects[0].kind == "coulomb_friction"
    assert model.effects[0].at == ("x", "ground")
    assert dict(model.effects[0].parameters) == {"force": 3.1}


@pytest.mark.parametrize("text", [FILE, ROTATION, RIG, OWN], ids=["file", "rotation", "rig", "own"])
def test_there_and_back(text, tmp_path):
    model = MechanicalModel.from_toml(text)
    first = next(iter(model.parameters))
    model = model.with_parameters({first: model.parameters[first] + 1 / 3})  # to the last digit
    path = tmp_path / "model.toml"
    assert path.write_text(model.to_toml(path)) > 0
    assert MechanicalModel.from_toml(path) == model
    assert MechanicalModel.from_toml(str(path)) == model
    assert [p.name for p in tmp_path.iterdir()] == ["model.toml"]


def test_effects_of_ones_own_in_the_file():
    before = list(kinds())
    model = MechanicalModel.from_toml(OWN)
    fifth, rim = model.effects
    assert (fifth.kind, fifth.values) == ("f = -k*q**5", {"k": 3e15})
    assert (rim.kind, rim.definition.title) == ("rim", "Drag at the rim")
    assert rim.definition.parameter("F").lower == 0.0
    assert rim.values["n"] == 1.7
    assert list(kinds()) == before  # a file offers nothing to later diagnoses
    text = model.to_toml()
    assert MechanicalModel.from_toml(text).to_toml() == text
    assert 'formula = "f = -k*q**5"\nunits = { k = "N/m^5" }\n' in text


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("q**5", "q^5", 7, ("formula",)),
        ('"N/m^5"', '"N/mm^5"', 8, ("units", "k")),
        ('"N/m^5"', '"N/m^3"', 7, ("formula",)),
        ("{ k = 3e15 }", "{ k = true }", 10, ("parameters", "k")),
        ("{ k = 3e15 }", "{ c = 1.0 }", 10, ("parameters",)),
        ('at = ["x", "ground"]', 'at = ["y", "ground"]', 9, ("at",)),
        ('formula = "f = -k*q**5"', 'formula = "f = -k*q**5"\nkind = "x"', 8, ("kind",)),
        ('units = { k = "N/m^5" }', "", 7, ("formula", "k")),
        ('units = { k = "N/m^5" }', 'units = "N/m^5"', 8, ("units",)),
    ],
)
def test_an_effect_of_ones_own_is_refused_with_its_line(old, new, line, key):
    with pytest.raises(InvalidInputError, match=f"line {line}:") as caught:
        MechanicalModel.from_toml(OWN.replace(old, new, 1))
    assert caught.value.key == ("effect", 0, *key)


def test_an_imposed_motion_in_the_file():
    model = MechanicalModel.from_toml(RIG)
    assert model.imposed == ("x",)
    assert model.state_space().input_labels == ["x", "v"]


def test_writing_to_nowhere_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="path"):
        MechanicalModel.from_toml(FILE).to_toml(tmp_path / "no" / "model.toml")


# Each replaces some text of FILE, and the message has to name the line and key.
EDITS = [
    ("mass = 0.2", "mass = -0.2", 7, "dof.x.mass"),
    ("mass = 0.2", "mas = 0.2", 7, "dof.x.mas"),
    ("mass = 0.2", "", 6, "mass or inertia"),
    ("mass = 0.2", "mass = true", 7, "dof.x.mass"),
    ('["x_m", "x"]', '["x_m", "y"]', 13, "spring[1].between"),
    ("stiffness = 2.9821e5", "stiffness = '3'", 14, "spring[1].stiffness"),
    ("stiffness = 2.9821e5", "", 12, "no stiffness"),
    ("damping = 13.16", "damping = inf", 17, "damper[0].damping"),
    ("force_on", "torque_on", 21, "units must match"),
    ('force_on = "x"', 'force_on = "z"', 19, "'z'"),
    ('force_on = "x"', "gain = 2", 19, "force_on"),
    ('force_on = "x"', 'force_on = "x"\ngian = 2', 22, "gian"),
    ('measures = "x"', 'measures = "x"\nrelative_to = "q"', 22, "'q'"),
    ('"displacement"', '"angle"', 25, "quantity"),
    ('"displacement"', '"position"', 25, "quantity"),
    ('"displacement"', '"force"', 24, "measures"),
    ("coulomb_friction", "colomb_friction", 28, "colomb_friction"),
    ('at = ["x", "ground"]\np', 'at = ["x", "q"]\np', 29, "'q'"),
    ("{ force", "{ farce", 30, "farce"),
    ("= 3.1", "= nan", 30, "force"),
    ("50.0", "-50.0", 2, "spin_frequency"),
    ("[dof.x]", "[dof.ground]", 6, "ground"),
    ("[dof.x_m]", "[body.x_m]", 4, "body"),
]


@pytest.mark.parametrize(("old", "new", "line", "key"), EDITS, ids=[e[1] or e[0] for e in EDITS])
def test_refused_with_line_and_key(old, new, line, key, tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(FILE.replace(old, new, 1))
    with pytest.raises(InvalidInputError) as caught:
        MechanicalModel.from_toml(path)
    message = str(caught.value)
    assert key in message
    found = re.search(r"line (\d+)", message)
    assert found, message
    assert int(found[1]) == line, message


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("[[damper]]", "[damper]", "damper"),
        ("[[output]]", "[[outputs]]", "output"),
        ('name = "air', "name = 3 # ", "name"),
        ("mass = 0.2\n", "mass = 0.2 0.3\n", "line 7"),
        ("[dof.x]", "[dof.x", "line 6"),
    ],
)
def test_refused_with_the_key(old, new, key):
    with pytest.raises(InvalidInputError, match=key):
        MechanicalModel.from_toml(FILE.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [("stiffness = 2.9821e5", "stiffness = '3'", ("spring", 1, "stiffness")),
     ("mass = 0.2", "mass = -0.2", ("dof", "x", "mass")),
     ("force_on", "torque_on", ("input", 0, "torque_on")),
     ("= 3.1", "= nan", ("effect", 0, "parameters", "force"))],
)  # fmt: skip
def test_errors_carry_the_key(old, new, key):
    with pytest.raises(InvalidInputError) as caught:
        MechanicalModel.from_toml(FILE.replace(old, new, 1))
    assert caught.value.key == key


def test_unreadable_files_are_refused(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00\x80")
    empty = tmp_path / "empty.toml"
    empty.write_text("")
    for source in (tmp_path, tmp_path / "missing.toml", binary, empty, 3, None):
        with pytest.raises(InvalidInputError):
            MechanicalModel.from_toml(source)


names = st.text(min_size=1, max_size=6).filter(lambda s: s.strip() and s != "ground")
numbers = st.floats(allow_nan=False, allow_infinity=False)


def test_any_names_and_numbers_survive():
    outcomes = Counter()

    @settings(max_examples=60, deadline=None, derandomize=True)
    @given(names, names, st.floats(1e-9, 1e9), numbers, numbers, names, names, names)
    def survive(a, b, mass, stiffness, damping, force, motion, title):
        drawn = (a, b, mass, stiffness, damping, force, motion, title)
        outcomes[written_and_read(*drawn)] += 1

    survive()
    assert outcomes["read"] >= 10  # many numbers are beyond any machine


def written_and_read(a, b, mass, stiffness, damping, force, motion, title):
    """Write a model and read it, unless its names or numbers are refused, and tell which."""
    try:
        model = MechanicalModel(
            [Dof(a, mass), Dof(b, 2 * mass, rotational=True)],
            [Spring((a, "ground"), stiffness)],
            [Damper((b, "ground"), damping)],
            [Input(force, (a, "ground"))],
            [Output(motion, (b, "ground"), "angular_velocity")],
            name=title,
        )
    except InvalidInputError:
        return "refused"  # two equal names, a dot in one, or a number beyond any machine
    text = model.to_toml()
    assert MechanicalModel.from_toml(text) == model
    assert model.state_space().nstates == 4
    return "read"
