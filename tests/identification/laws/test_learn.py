"""Laws of simulated machines that the catalogue does not hold are learned, and no others."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.fit.least_squares import best_stage, homotopy
from robustpolish.identification.structure.spline_laws import (
    CURVES,
    OVER_TIME,
    learn,
    resampled_spline,
    with_knots_over_motion,
)
from tests.hidden_effects.cases import Case, Machine, model_of, one, records
from tests.hidden_effects.catalogue import all_cases
from tests.identification.discover.searches import search_of

PLACE = ("x", "ground")
LISTED = {case.name: case for case in all_cases()}
CASES = {
    "fifth": LISTED["fifth power"],
    "saturating": LISTED["saturating spring"],
    "saturating, velocity": replace(
        LISTED["saturating spring"], machine=replace(one(), measured=[("x", "velocity")])
    ),
    "drifting": LISTED["stiffness drifts"],
    "nothing": LISTED["nothing, one mass"],
    "power": Case("power", one(), [("power_damping", PLACE, [4.0, 1.5])], drive=20, seed=904),
    "dead zone": Case(
        "dead zone",
        one(),
        [("dead_zone_spring", PLACE, [6000.0, 0.006]), ("coulomb_friction", PLACE, [4.0, 0.01])],
        drive=20,
        seed=901,
    ),
}
TRUE = {
    "fifth": lambda q: 1.2e10 * q**5,
    "saturating": lambda q: -2000 * q + 8 * np.tanh(q / 0.004),
    "dead zone": lambda q: 6000 * np.sign(q) * np.maximum(np.abs(q) - 0.006, 0),
    "power": lambda v: 4 * np.sign(v) * np.abs(v) ** 1.5,
}
TRUE["saturating, velocity"] = TRUE["saturating"]


@lru_cache
def learned(name):
    """What is learned of a machine whose model has none of the effects, and an unseen record."""
    case = CASES[name]
    (data, _), (unseen, noise) = records(case)
    search = search_of(model_of(case), data)
    return learn(search.stage.model, search.prepared, search.reference), unseen, noise


def check(name, over, largest=1.5):
    found, unseen, noise = learned(name)
    assert found is not None
    assert found.explains, found.evidence()
    assert "explains what was left" in found.evidence()
    assert found.laws[0].over == over
    assert found.laws[0].effect.at == PLACE
    # what the model was given stays: the curve is what it lacked
    assert found.model.parameters["spring[0].stiffness"] == pytest.approx(3000, rel=1e-2)
    ((output, size),) = noise.items()
    assert rp.compare(found.model, unseen).outputs[output].rmse < largest * size
    curve = found.laws[0].curve()
    along = curve[over].values
    off = np.abs(curve["force"].values - TRUE[name](along)) / curve["stderr"].values
    assert np.mean(off < 2) > 0.85
    assert float(curve["stderr"].median()) < 0.01 * float(np.abs(curve["force"]).max())
    return found


@pytest.mark.long
def test_a_fifth_power():
    found = check("fifth", "displacement")
    formula = found.laws[0].formula()
    assert formula.expression == "k5*q**5"
    assert formula.numbers["k5"] == pytest.approx(1.2e10, rel=0.02)
    assert found.tried[0].odds > 100
    again = rp.MechanicalModel.from_toml(found.model.to_toml())
    assert again == found.model


def test_a_damping_between_the_powers():
    found = check("power", "velocity")
    assert "takes energy out" in found.laws[0].describe()


def test_surfaces_are_left_out_on_request():
    (data, _), _ = records(CASES["power"])
    search = search_of(model_of(CASES["power"]), data)
    kept = learn(search.stage.model, search.prepared, search.reference, CURVES)
    every, _, _ = learned("power")
    kinds = {(t.at, t.over) for t in kept.tried}
    assert kinds <= {(t.at, t.over) for t in every.tried}
    assert len(every.tried) - len(kept.tried) == 1
    assert kept.laws[0].over == "velocity"


@pytest.mark.long
def test_a_saturating_spring():
    formula = check("saturating", "displacement").laws[0].formula()
    assert formula.expression == "k*q + Fs*tanh(q/d)"
    assert formula.numbers["k"] == pytest.approx(-2000, rel=0.02)


@pytest.mark.long
def test_a_spring_that_only_a_velocity_shows_is_counted_from_rest_and_has_no_friction_beside():
    formula = check("saturating, velocity", "displacement").laws[0].formula()
    assert formula.expression == "k*q + Fs*tanh(q/d)"
    assert formula.numbers["k"] == pytest.approx(-2000, rel=0.02)
    found, _, _ = learned("saturating, velocity")
    assert [e.kind for e in found.model.effects] == [found.laws[0].effect.kind]


@pytest.mark.long
def test_a_dead_zone_with_friction():
    found = check("dead zone", "displacement")
    friction = next(e for e in found.model.effects if e.kind == "coulomb_friction")
    assert friction.values["force"] == pytest.approx(4.0, rel=0.1)
    assert "dead zone from -0.00" in found.laws[0].describe()


@pytest.mark.long
def test_a_stiffness_that_drifts():
    case = CASES["drifting"]
    (data, _), (unseen, noise) = records(case)
    search = search_of(model_of(case), data)
    found = learn(search.stage.model, search.prepared, search.reference, OVER_TIME)
    assert found.explains, found.evidence()
    assert found.evidence().startswith("A stiffness over time at x, ground takes")
    (law,) = found.laws
    assert (law.over, law.quantity) == ("time", "stiffness")
    assert found.model.parameters["spring[0].stiffness"] == pytest.approx(3000, rel=1e-2)
    # the unseen record drifts alike from its beginning on
    assert rp.compare(found.model, unseen).outputs["x"].rmse < 1.1 * noise["x"]
    formula = law.formula()
    assert formula.expression == "a1*t"
    assert formula.numbers["a1"] == pytest.approx(700 / 16, rel=0.02)
    again = rp.MechanicalModel.from_toml(found.model.to_toml())
    assert again == found.model


def test_a_drift_is_found_though_the_fit_without_it_bent_the_masses():
    """A sweep passes two modes at two times: one stiffness for both is another machine."""
    machine = Machine(
        ["a", "b"],
        [1.5, 1.25],
        [("a", "ground", 13000.0), ("b", "a", 16000.0)],
        [("a", "ground", 12.0), ("b", "a", 15.0)],
        ["a"],
        [("a", "displacement"), ("b", "displacement")],
        f_max=25.0,
        dt=2e-3,
    )
    case = Case(
        "drift in a sweep", machine, [("drifting_stiffness", ("a", "ground"), [3300.0, 12.0])],
        "unknown_law", noise_db=50.0, samples=5400, excitation="sweep",
        wrong={"mass": -0.04, "stiffness": -0.06, "damping": -0.12},
    )  # fmt: skip
    search = search_of(model_of(case), records(case)[0][0])
    model, prepared = search.stage.model, search.prepared
    assert model.parameters["dof.a.mass"] < 0.7 * 1.5
    assert learn(model, prepared, model, OVER_TIME) is None
    found = learn(model, prepared, search.reference, OVER_TIME)
    assert found.explains, found.evidence()
    (law,) = found.laws
    assert (law.effect.at, law.quantity) == (("a", "ground"), "stiffness")
    assert found.model.parameters["dof.a.mass"] == pytest.approx(1.5, rel=2e-3)


def test_what_varies_is_not_claimed_where_nothing_does():
    case = CASES["nothing"]
    (data, _), _ = records(case)
    search = search_of(model_of(case), data)
    found = learn(search.stage.model, search.prepared, search.reference, OVER_TIME)
    assert found is None


@pytest.mark.parametrize("name", ["drifting", "nothing"])
def test_what_is_no_law_of_the_motion_is_not_claimed(name):
    found, _, _ = learned(name)
    assert found is None or (not found.explains and "does not explain" in found.evidence())


def test_knots_lie_over_the_motion_that_the_model_shows():
    """Where the motion was thought to be twice as large nobody has seen the curve."""
    search = search_of(model_of(CASES["fifth"]), records(CASES["fifth"])[0][0])
    prepared, reference = search.prepared, search.reference
    model = learned("fifth")[0].model
    narrow = model.effects[0]
    low, high = narrow.values["low"], narrow.values["high"]
    wide = resampled_spline(narrow, 2 * low, 2 * high, 11)
    span = prepared.spans(prepared.trial)[-1:]
    begun = replace(model, effects=(wide,))
    fits = homotopy(begun, prepared, prepared.trial, reference, span, known=True)
    stage = with_knots_over_motion(best_stage(fits, prepared), 0, prepared, reference)
    (law,) = stage.model.effects
    assert law.kind == "learned_stiffness_11"
    for end, wanted in (("low", low), ("high", high)):
        assert law.values[end] == pytest.approx(wanted, abs=0.1 * (high - low))
    assert with_knots_over_motion(stage, 0, prepared, reference) is stage
