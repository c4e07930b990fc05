"""Parts that do not fit together are refused, with the key."""

import pickle

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.user_defined import own_kind
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.models.mechanical.two_masses import GROUND, two_masses


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Dof("x", -1.0), ("dof", "x", "mass")),
        (lambda: Dof("x", "1", rotational=True), ("dof", "x", "inertia")),
        (lambda: two_masses(springs=[Spring(GROUND, np.nan)]), ("spring", 0, "stiffness")),
        (lambda: two_masses(dampers=[Damper(("x", "y"), 1.0)]), ("damper", 0, "between")),
        (lambda: Input("F", GROUND, gain=0), ("input", "F", "gain")),
        (lambda: two_masses(inputs=[Input("F", GROUND)] * 2), ("input", "F")),
        (lambda: two_masses(outputs=[Output("x", GROUND, "angle")]), ("output", "x", "quantity")),
        (
            lambda: two_masses(inputs=[Input("v", GROUND, "velocity")]),
            ("input", "v", "motion_of"),
        ),
        (lambda: two_masses().with_effect("input_gain", "x"), ("effect", 0, "at")),
        (lambda: two_masses(spin_frequency=-1.0), ("spin_frequency",)),
    ],
)
def test_errors_carry_keys(make, key):
    with pytest.raises(InvalidInputError) as caught:
        make()
    assert caught.value.key == key
    assert pickle.loads(pickle.dumps(caught.value)).key == key


BAD = {
    "mass": (lambda: two_masses(dofs=[Dof("x", -1.0)]), r"dof\.x\.mass"),
    "zero mass": (lambda: MechanicalModel([Dof("x", 0.0)], outputs=[Output("x", GROUND)]), "mass"),
    "no dof": (lambda: MechanicalModel([]), "dof"),
    "no output": (lambda: MechanicalModel([Dof("x", 1.0)]), "output"),
    "text for a number": (lambda: Dof("x", "1"), "quotation marks"),
    "nan": (lambda: two_masses(springs=[Spring(GROUND, np.nan)]), r"spring\[0\]\.stiffness"),
    "nowhere": (lambda: two_masses(springs=[Spring(("x", "y"), 1.0)]), r"'y'.*x_m, x, ground"),
    "one end": (lambda: two_masses(springs=[Spring(("x",), 1.0)]), "two ends"),
    "same end": (lambda: two_masses(dampers=[Damper(("x", "x"), 1.0)]), "twice"),
    "same dof": (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("x", 1.0)]), "of this name"),
    "same input": (lambda: two_masses(inputs=[Input("F", GROUND)] * 2), "of this name"),
    "same output": (lambda: two_masses(outputs=[Output("x", GROUND)] * 2), "of this name"),
    "gain": (lambda: Input("F", GROUND, gain=0), "gain"),
    "quantity": (lambda: two_masses(outputs=[Output("x", GROUND, "position")]), "quantity"),
    "angle of a mass": (lambda: two_masses(outputs=[Output("x", GROUND, "angle")]), "which has"),
    "mixed": (
        lambda: MechanicalModel(
            [Dof("x", 1.0), Dof("p", 1.0, rotational=True)],
            [Spring(("x", "p"), 1.0)],
            outputs=[Output("x", GROUND)],
        ),
        "one in m and one in rad",
    ),
    "velocity alone": (lambda: two_masses(inputs=[Input("v", GROUND, "velocity")]), "displacement"),
    "force on imposed": (
        lambda: two_masses(inputs=[Input("b", GROUND, "displacement"), Input("F", GROUND)]),
        "imposed",
    ),
    "drive of a free mass": (
        lambda: two_masses(outputs=[Output("D", ("x",), "force", drive=True)]),
        "imposes",
    ),
    "spin": (lambda: two_masses(spin_frequency=-1.0), "spin_frequency"),
    "unknown effect": (lambda: two_masses().with_effect("magic", GROUND), "magic"),
    "effect nowhere": (lambda: two_masses().with_effect("coulomb_friction", ("u", "x")), "'u'"),
    "effect on no input": (lambda: two_masses().with_effect("input_gain", "x"), "one of F"),
    "velocity's name": (lambda: two_masses(dofs=[Dof("x", 1.0), Dof("dx", 1.0)]), "velocity of"),
    "a string of dofs": (lambda: MechanicalModel("x"), "list"),
    "control": (lambda: two_masses().linearize(controls=["q"]), "controls"),
    "operating point": (lambda: two_masses().linearize(operating_point={"q": 1.0}), "'q'"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused_with_the_key(case):
    make, message = BAD[case]
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_what_an_effect_reads_has_to_be_there():
    kind = own_kind({"formula": "f = -c*u*v", "units": {"c": "N s/(m V)"}, "channels": {"u": "V"}})
    with pytest.raises(InvalidInputError, match="with_channel") as caught:
        two_masses(effects=[Effect.of(kind, GROUND)])
    assert caught.value.key == ("effect", 0, "at")
