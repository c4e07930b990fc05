"""Diagnoses of the air bearing under the brush, of machines that an integrator of its own made."""

import time
from dataclasses import replace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.search.screening import places
from tests.identification.air_bearings import MODEL, measured

X, Y, BEARING, Z = ("x", "ground"), ("y", "ground"), ("x_m", "ground"), ("z", "ground")
NOSE = ("x", "y", "z", "x_m", "y_m")
CASES = {
    "coulomb x": {"kind": "coulomb_friction", "at": X, "numbers": (0.3,)},
    "coulomb y": {"kind": "coulomb_friction", "at": Y, "numbers": (0.5,)},
    "coulomb bearing": {
        "kind": "coulomb_friction",
        "at": BEARING,
        "numbers": (2.0,),
        "sensors": NOSE,
    },
    "stop z": {"kind": "contact_stop", "at": Z, "numbers": (-8e-7, 3e7)},
    "stop x": {"kind": "contact_stop", "at": X, "numbers": (8e-6, 2e5)},
    "cubic rod": {"kind": "cubic_stiffness", "at": ("x", "x_m"), "numbers": (1e13,)},
    "cross stiffness": {"kind": "cross_stiffness", "at": ("x", "y"), "numbers": (2e3,)},
    "gyroscopic": {"kind": "gyroscopic_coupling", "at": ("x", "y"), "numbers": (5.0,)},
    "delay": {"late": 2},
    "gain of a sensor": {"gains": {"y": 1.05}},
    "wrong masses": {"masses": {"x": 0.23, "y": 0.23, "z": 0.23}},
    "nothing": {},
}
OF_SIGNALS = {"delay": "delay", "gain of a sensor": "gain"}


def outcome(name):
    """Return whether a diagnosis names the effect, whether it names a wrong one, and its time."""
    case, begun = CASES[name], time.process_time()
    found = rp.diagnose(MODEL, measured(**case), progress=lambda _: None)
    seconds = time.process_time() - begun
    named = [(effect.kind, frozenset(effect.at)) for effect in found.effects]
    alike = {(p.second.kind, frozenset(p.second.at)) for p in found.indistinguishable}
    if name in OF_SIGNALS:
        right = bool(named) and all(OF_SIGNALS[name] in kind for kind, _ in named)
    elif "kind" in case:
        truth = (case["kind"], frozenset(case["at"]))
        right = len(named) == 1 and truth in {*named, *alike}
    else:
        wanted = "adequate" if name == "nothing" else "parameters"
        right = not named and found.verdict == wanted
    return right, bool(named) and not right and found.verdict == "missing_effect", seconds


def test_right_numbers_raise_no_suspicion_of_units():
    """Also c_Z = 1e-8 N s/m of the thesis, which stands for no damper, and which a fit may move."""
    assert not any("unit" in note for note in rp.refit(MODEL, measured(duration=0.1)).notes)


def test_nothing_is_sought_between_axes_at_right_angles():
    tried = places(MODEL, rp.effects.lookup("coulomb_friction"))
    axes = [{MODEL.dof(name).axis for name in at if name != "ground"} for at in tried]
    assert all(len(axis) == 1 for axis in axes)
    unknown = replace(MODEL, dofs=tuple(replace(dof, axis="") for dof in MODEL.dofs))
    assert len(tried) < len(places(unknown, rp.effects.lookup("coulomb_friction")))


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_what_an_air_bearing_hides_is_named():
    outcomes = {name: outcome(name) for name in CASES}
    for name, (right, wrong, seconds) in outcomes.items():
        told = "right" if right else "wrong name" if wrong else "open"
        print(f"{name:20}{told:12}{seconds:6.0f} s")
    print(f"median {np.median([seconds for *_, seconds in outcomes.values()]):.0f} s")
    assert sum(right for right, *_ in outcomes.values()) >= 11
    assert not any(wrong for _, wrong, _ in outcomes.values())
