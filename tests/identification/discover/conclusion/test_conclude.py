import re
from dataclasses import replace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.kalman import FREE, Level
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.identification.structure.decays import DecaySplit
from robustpolish.identification.structure.screening import ScreenedEffect, Screening
from robustpolish.identification.structure.spline_laws import CURVES, KINDS, OVER_TIME, SINGLE_CURVE
from robustpolish.identification.structure.state import RefittedEffect, SelectionStep
from robustpolish.identification.structure.verdict import conclude
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.effects.kind import Motion
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.identification.discover.searches import refitted, search_of
from tests.identification.oscillators import PLACE, of_rig, rig

DATA = of_rig(1500, noise=2.0)
X, V = DATA["x"].values, DATA["v"].values
KEYS = {"spring[0].stiffness", "damper[0].damping"}


def searched(force, *effects, model, policy=POLICY):
    """A search on a rig with more force, and effects that were accepted."""
    search = search_of(model, DATA.assign(f=("time", DATA["f"].values + force)), policy)
    for effect in effects:
        fitted = search.fit_with(search.stage.model, effect)
        search.accept([RefittedEffect(ScreenedEffect(effect, 100.0, 0.5), fitted)])
    return search


def concluded(force, *effects, model=None, policy=POLICY):
    """What is said in the end of such a search."""
    model = rig() if model is None else model
    return conclude(searched(force, *effects, model=model, policy=policy), model)


def test_a_model_that_leaves_noise_is_adequate():
    found = concluded(0.0)
    assert found.verdict == "adequate"
    assert found.effects == ()
    assert set(found.parameters) == KEYS
    assert found.covariance.shape == (2, 2)
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit"]
    assert found.noise_floor["f"] * np.std(DATA["f"]) == pytest.approx(2.0, rel=0.05)
    assert found.missing_force.shape == (1, 1500)
    assert found.sites == (PLACE,)
    np.testing.assert_array_equal(found.time, DATA["time"])


def test_a_model_whose_numbers_were_wrong_is_told_so():
    found = concluded(0.0, model=rig(40.0, 3.0))
    assert found.verdict == "parameters"
    stiffness = found.parameters["spring[0].stiffness"]
    assert abs(stiffness.value - 50.0) < 4 * stiffness.stderr < 2.0
    assert stiffness.unit == "N/m"
    base, refitted = (entry.nrmse["f"] for entry in found.ledger.entries)
    assert base > 1.1 * refitted


def test_what_was_added_is_the_finding():
    found = concluded(40 * X**3, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0}))
    assert found.verdict == "missing_effect"
    (effect,) = found.effects
    assert (effect.kind, effect.at) == ("cubic_stiffness", PLACE)
    value = effect.parameters["stiffness"]
    assert value.unit == "N/m^3"
    assert abs(value.value - 40.0) < 4 * value.stderr < 8.0
    assert found.model.parameters["effect[0].stiffness"] == value.value
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit", "cubic_stiffness"]
    assert found.reasons[-1].endswith("% of the error above the noise.")


LEARN = "robustpolish.identification.structure.spline_laws.learn"
CUT_DECAYS = "robustpolish.identification.structure.decays.split_decays"
BETTER_SHAPE = "robustpolish.identification.structure.spline_laws.better_shape"
THREE = (
    Effect("cubic_stiffness", PLACE, {"stiffness": 100.0}),
    Effect("quadratic_damping", PLACE, {"coefficient": 1.0}),
    Effect("quadratic_stiffness", PLACE, {"stiffness": 1.0}),
)
CROWDED = 400 * X**3 + 60 * X**2 + 3 * V * np.abs(V) + 9 * X**2 * V
"""The three at once, and a force that has no name."""


def test_what_no_effect_explains_is_learned_as_a_law():
    found = concluded(40 * X**3)
    assert found.verdict == "unknown_law"
    (effect,) = found.effects
    assert effect.kind.startswith("learned_stiffness")
    assert len(found.laws) == 1
    assert "explains what was left" in found.reasons[-1]
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit", effect.kind]


def asked_of_a_cubic_spring(monkeypatch):
    """What is tried where no effect explains a cubic spring, and no law does."""
    asked = []
    monkeypatch.setattr(LEARN, lambda *given: asked.append(given[3]))
    assert concluded(40 * X**3).verdict == "unexplained"
    return asked


@pytest.mark.parametrize("quieter_held_out", [False, True])
def test_what_varies_with_time_is_sought_where_no_law_of_the_motion_explains(
    monkeypatch, quieter_held_out
):
    """Also in a motion that fades as a sweep does that has passed its resonance."""
    monkeypatch.setattr(PreparedRecord, "fades", quieter_held_out)
    assert asked_of_a_cubic_spring(monkeypatch) == [KINDS, OVER_TIME]


def test_in_a_free_decay_nothing_is_said_to_vary_with_time(monkeypatch):
    record = record_of(rig(), DATA)
    monkeypatch.setattr(CUT_DECAYS, lambda *_: DecaySplit([record], [record]))
    assert asked_of_a_cubic_spring(monkeypatch) == [KINDS]


@pytest.mark.parametrize("named", [True, False])
def test_a_surface_is_asked_for_only_where_names_fail(monkeypatch, named):
    """Three effects at one place may all be one curve; a surface over both is whatever they are."""
    asked = []
    monkeypatch.setattr(LEARN, lambda *given: asked.append(given[3]))
    found = concluded(CROWDED, *(THREE if named else []))
    assert asked == ([CURVES] if named else [KINDS, OVER_TIME])
    assert (found.verdict == "missing_effect") == named


@pytest.mark.parametrize(("force", "law"), [(60 * np.tanh(4 * X), True), (60 * X**3, False)])
def test_a_curve_takes_the_place_of_names_only_if_it_leaves_visibly_less(monkeypatch, force, law):
    monkeypatch.setattr(BETTER_SHAPE, lambda *_: None)
    policy = replace(POLICY, shape_above=0.5)  # a law is asked for in any case
    found = concluded(force, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0}), policy=policy)
    assert found.verdict == ("unknown_law" if law else "missing_effect")
    assert [e.kind for e in found.effects] == [
        found.laws[0].effect.kind if law else "cubic_stiffness"
    ]
    assert not any("was not taken" in reason for reason in found.reasons)


def hardly_saturating(**policy):
    """Conclude on a saturating spring that is nearly the cubic one as which it was named."""
    cubic = Effect("cubic_stiffness", PLACE, {"stiffness": -10.0})
    return concluded(60 * np.tanh(X), cubic, policy=replace(POLICY, **policy))


def test_a_law_beside_which_nothing_shows_replaces_names_beside_which_more_does():
    """Though they leave what may be noise, and it leaves less, but not visibly."""
    found = hardly_saturating()
    assert found.verdict == "unknown_law"
    assert [effect.kind for effect in found.effects] == [found.laws[0].effect.kind]
    named = re.search(r"Not kept, with (\S+) times the error: cubic_stiffness", found.reasons[-1])
    assert 1.02 < float(named[1]) < 1.25


def test_no_law_is_asked_for_where_nothing_shows_beside_names(monkeypatch):
    asked = []
    monkeypatch.setattr(LEARN, lambda *given: asked.append(given[3]))
    found = concluded(40 * X**3, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0}))
    assert found.verdict == "missing_effect"
    assert not asked


def test_a_law_that_leaves_less_but_not_visibly_is_told(monkeypatch):
    monkeypatch.setattr(BETTER_SHAPE, lambda *_: None)
    # a law is asked for in any case, and something shows beside everything
    found = hardly_saturating(shape_above=0.5, least_odds=-np.inf)
    assert [effect.kind for effect in found.effects] == ["cubic_stiffness"]
    told = r"A force over displacement at x, ground, learned, was not taken: it leaves (\d+)% less"
    (share,) = filter(None, (re.match(told, reason) for reason in found.reasons))
    assert 2 <= int(share[1]) < 20


def test_what_no_law_explains_either_is_unexplained(monkeypatch):
    monkeypatch.setattr(LEARN, lambda *_: None)
    found = concluded(40 * X**3)
    assert found.verdict == "unexplained"
    assert found.reasons[-1] == "No effect of the catalogue makes the error fall visibly."


def test_friction_under_sines_is_no_noise():
    assert concluded(20.0 * np.sign(V)).verdict in ("unexplained", "unknown_law")


def test_what_explains_a_part_is_kept_and_the_rest_is_told():
    push = 40 * X**3 + 3 * X**2 * V  # no function of either alone
    found = concluded(push, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0}))
    assert found.verdict == "partly_explained"
    (effect,) = found.effects
    assert effect.kind == "cubic_stiffness"
    assert found.model.effects == (found.model.effects[0],)
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit", "cubic_stiffness"]
    told = found.reasons[-1]
    explained, left = (int(word) for word in re.findall(r"(\d+) %", told))
    assert told.endswith("% is left.")
    assert explained + left == 100
    assert 0 < explained < 100
    floor, error = found.noise_floor["f"], found.ledger.entries[-1].nrmse["f"]
    assert error > 1.25 * floor


def test_what_helps_a_bit_and_has_no_size_gets_no_name(monkeypatch):
    """Of a spring that drifts a mass that hangs somewhere takes a part, whatever that weighs."""
    monkeypatch.setattr(
        "robustpolish.identification.structure.score.undetermined_parameter",
        lambda *_, **__: "stiffness",
    )
    monkeypatch.setattr(LEARN, lambda *_: None)
    push = 40 * X**3 + 3 * X**2 * V
    found = concluded(push, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0}))
    assert found.verdict == "unexplained"
    assert found.effects == found.model.effects == ()
    assert found.reasons[-2] == "What helps has no size that the data determine."


def test_what_is_left_far_above_the_noise_is_told_though_most_is_explained():
    push = 400 * X**3 + 9 * X**2 * V
    found = concluded(push, Effect("cubic_stiffness", PLACE, {"stiffness": 100.0}))
    assert found.verdict == "missing_effect"
    times, shares = found.reasons[-2:]
    floor, error = found.noise_floor["f"], found.ledger.entries[-1].nrmse["f"]
    assert float(re.findall(r"[\d.]+\d", times)[0]) == pytest.approx(error / floor, rel=0.01)
    assert error > POLICY.far * floor
    assert int(re.findall(r"(\d+) %", shares)[0]) > 100 * POLICY.explained


def test_a_simpler_kind_stays_where_the_data_leave_numbers_open():
    """A drag that does nothing above the jump: only the force of the friction is determined."""
    more = {"force": 30.0, "static_force": 30.0, "velocity": 1e-3}
    found = concluded(30.0 * np.sign(V), Effect("stribeck_friction", PLACE, more))
    (effect,) = found.effects
    assert effect.kind == "coulomb_friction"
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit", "coulomb_friction"]
    pairs = [{pair.first.kind, pair.second.kind} for pair in found.indistinguishable]
    assert {"coulomb_friction", "stribeck_friction"} in pairs


def test_what_explains_next_to_nothing_of_the_whole_is_not_kept(monkeypatch):
    monkeypatch.setattr(BETTER_SHAPE, lambda *_: None)
    monkeypatch.setattr(LEARN, lambda *_: None)
    found = concluded(40 * X**3, Effect("quadratic_damping", PLACE, {"coefficient": 0.1}))
    assert found.verdict == "unexplained"
    assert found.effects == found.model.effects == ()
    nearest = "quadratic_damping at x, ground"
    assert found.reasons[-1] == f"The nearest of the catalogue, not kept: {nearest}."
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit"]


def test_a_law_that_is_none_of_the_catalogue_keeps_no_name(monkeypatch):
    monkeypatch.setattr(BETTER_SHAPE, lambda *_: "Another law.")
    monkeypatch.setattr(LEARN, lambda *_: None)
    found = concluded(
        40 * X**3 + 3 * X**2 * V, Effect("cubic_stiffness", PLACE, {"stiffness": 10.0})
    )
    assert found.verdict == "unexplained"
    assert found.effects == found.model.effects == ()
    assert found.reasons[-2:] == (
        "Another law.", "The nearest of the catalogue, not kept: cubic_stiffness at x, ground.",
    )  # fmt: skip
    assert [entry.step for entry in found.ledger.entries] == ["base", "refit"]


def test_a_constant_beside_friction_may_be_its_asymmetry():
    force = 8.0 * np.sign(V) + 5.0
    friction, offset = Effect("coulomb_friction", PLACE), Effect("sensor_offset", "f")
    found = concluded(force, friction, offset)
    assert [effect.kind for effect in found.effects] == ["coulomb_friction", "sensor_offset"]
    (pair,) = found.indistinguishable
    assert pair.first.kind == "sensor_offset"
    assert pair.first.values["offset"] == pytest.approx(5.0, rel=0.1)
    assert pair.second.values["asymmetry"] == pytest.approx(-5.0, rel=0.1)
    assert "constant_force" not in pair.experiment


def test_a_jump_of_friction_is_rounded_where_the_data_tell():
    """The force of a jump in its place is off by many standard errors, the error by a per cent."""
    friction = Effect("coulomb_friction", PLACE, {"force": 20.0})
    speed = 0.15 * np.std(V)
    (effect,) = concluded(30.0 * np.tanh(V / speed), friction).effects
    assert effect.parameters["width"].value == pytest.approx(speed, rel=0.1)
    for name, truth in (("force", 30.0), ("width", speed)):
        found = effect.parameters[name]
        assert abs(found.value - truth) < 3 * found.stderr
    (effect,) = concluded(30.0 * np.sign(V), friction).effects
    assert "width" not in effect.parameters


def test_of_friction_with_memory_the_whole_record_tells_the_kind():
    """Dahl's law has no force beyond the one of sliding, at which it begins to move."""
    truth = {"force": 20.0, "static_force": 30.0, "velocity": 2.0, "stiffness": 200.0, "damping": 0}
    lugre = Effect("lugre_friction", PLACE, truth)
    along = Motion(DATA["time"].values, X[None], V[None])
    force = -force_with(lugre.definition, lugre.values, along).ravel()
    found = concluded(force, Effect("dahl_friction", PLACE, {"force": 25.0, "stiffness": 200.0}))
    (effect,) = found.effects
    assert effect.kind == "lugre_friction"
    for name in ("force", "static_force", "velocity", "stiffness"):
        value = effect.parameters[name]
        assert abs(value.value - truth[name]) < 3 * value.stderr
    assert any("dahl_friction" in r and "less likely" in r for r in found.reasons)
    assert found.ledger.entries[-1].step == "lugre_friction"
    # the loops of Bouc and Wen and LuGre's law hold Dahl's: their further numbers are not needed
    dahl = Effect("dahl_friction", PLACE, {"force": 20.0, "stiffness": 80.0})
    found = concluded(-force_with(dahl.definition, dahl.values, along).ravel(), dahl)
    assert [e.kind for e in found.effects] == ["dahl_friction"]
    alike = {p.second.kind for p in found.indistinguishable}
    assert alike == {"bouc_wen_hysteresis", "lugre_friction"}


def test_a_friction_that_turns_over_gently_has_no_memory(monkeypatch):
    """What a jump leaves at every reversal speaks for Dahl's law, until the jump is rounded."""
    instead = {"dahl_friction": [Effect("coulomb_friction", PLACE, {"force": 1.0})]}
    monkeypatch.setattr(
        "robustpolish.identification.structure.moves_replace.close_force_equivalents",
        lambda _, model, at: instead.get(model.effects[at].kind, []),
    )
    speed = 0.1 * np.std(V)
    # so weak a friction comes within log odds of 20; that Dahl's law did is not forgotten
    for force, policy, like in (
        (30.0, POLICY, []),
        (2.0, POLICY, []),
        (2.0, replace(POLICY, strong_odds=20.0), ["dahl_friction"]),
    ):
        dahl = Effect("dahl_friction", PLACE, {"force": force, "stiffness": 200.0})
        found = concluded(force * np.tanh(V / speed), dahl, policy=policy)
        (effect,) = found.effects
        assert effect.kind == "coulomb_friction"
        for name, truth in (("force", force), ("width", speed)):
            value = effect.parameters[name]
            assert abs(value.value - truth) < 3 * value.stderr
        assert [p.second.kind for p in found.indistinguishable] == like
        assert any("dahl_friction" in r and "less likely" in r for r in found.reasons)


def test_noise_on_inputs_is_no_error_that_an_effect_has_to_explain():
    """Screening saw no missing force but noise on the inputs: what is left is that."""
    slow = np.convolve(np.random.default_rng(3).standard_normal(1699), np.ones(200) / 14, "valid")
    search = search_of(rig(), DATA.assign(f=("time", DATA["f"].values + 3.0 * slow)))
    assert conclude(search, rig()).verdict == "unexplained"
    for level, said in (
        (FREE, "unexplained"),
        (Level(0.0, input_noise=0.03), "adequate"),
        (Level(1.0, input_noise=0.03), "unexplained"),
    ):
        silent = replace(search, screening=Screening((), (), level))
        found = conclude(silent, rig())
        assert found.verdict == said
        assert any("like a noise on the inputs" in r for r in found.reasons) == (said == "adequate")
    # what was refused, but leaves visibly less, held out or where it was fitted, says it is none
    for held_out, fitted, said in (
        (0.7, 1.0, "unexplained"), (0.9, 1.0, "adequate"), (1.0, 0.7, "unexplained"),
    ):  # fmt: skip
        left, loud = held_out * search.stage.error, fitted * search.stage.fitted
        tried = refitted(rig(), "cubic_stiffness", PLACE, {"stiffness": 3.0}, left)
        tried = replace(tried, fitted=replace(tried.fitted, over_fitted=lambda loud=loud: loud))
        noisy = replace(search, screening=Screening((), (), Level(0.0, input_noise=0.03)))
        noisy.selection_steps = [SelectionStep(noisy.copy(), (), (), (tried,))]
        assert conclude(noisy, rig()).verdict == said


def test_what_three_effects_at_one_place_leave_is_no_noise_on_the_inputs(monkeypatch):
    """One curve may be all three and what they leave: a dead zone was a stop and two others."""
    for named in (THREE[:2], THREE):
        asked = []
        monkeypatch.setattr(LEARN, lambda *given, asked=asked: asked.append(given[3]))
        search = searched(CROWDED, *named, model=rig())
        search.screening = Screening((), (), Level(0.0, input_noise=0.03))
        found = conclude(search, rig())
        noise = any("like a noise on the inputs" in reason for reason in found.reasons)
        assert noise == (len(named) < 3)
        # one curve may leave visibly less than what is like a noise on the inputs
        assert asked == ([SINGLE_CURVE, OVER_TIME] if noise else [CURVES])


def test_a_kind_whose_numbers_are_left_open_gives_way_to_a_simpler_one():
    """A real damper: its loops have a force and a stiffness, but hardly a shape of their own."""
    record = rp.datasets.mr_damper().isel(time=slice(0, 940))
    motion = [Input("x", PLACE, "displacement"), Input("v", PLACE, "velocity")]
    model = MechanicalModel(
        [Dof("x", 0.0)], [Spring(PLACE, 100.0)], [Damper(PLACE, 1500.0)], motion,
        [Output("F", PLACE, "force")],
    )  # fmt: skip
    found = rp.diagnose(model, record)
    (effect,) = found.effects
    assert all(value.stderr < 0.5 * abs(value.value) for value in effect.parameters.values())
    assert {pair.first.kind for pair in found.indistinguishable} == {effect.kind}
    assert effect.kind == "dahl_friction"
    # LuGre's law whose static force is its sliding one is Dahl's
    alike = {pair.second.kind for pair in found.indistinguishable}
    assert alike == {"bouc_wen_hysteresis", "lugre_friction"}
