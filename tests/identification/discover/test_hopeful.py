import numpy as np
import pytest

from robustpolish.identification.observer.kalman import FREE
from robustpolish.identification.refit import fit_own_parameters
from robustpolish.identification.structure.candidates import family_alternatives, select_candidates
from robustpolish.identification.structure.evidence import Evidence
from robustpolish.identification.structure.screening import ScreenedEffect, Screening, screen
from robustpolish.machines.effects.effect import Effect
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, oscillator, record

PATH = "robustpolish.identification.structure.evidence.evidence"


@pytest.fixture(scope="module")
def begun():
    prepared = prepared_of(oscillator(), record(2000, noise=0.01))
    return fit_own_parameters(oscillator(), prepared).stage.fit, prepared


def place_of(kind):
    if kind.startswith("input_"):
        return "F"
    return "x" if kind in ("constant_force", "harmonic_force") else PLACE


def candidate(kind, score, remark=""):
    return ScreenedEffect(Effect(kind, place_of(kind)), score, 0.5, remark)


def evident(fall, *named, odds=100.0):
    return Evidence((), tuple(Effect(kind, place_of(kind)) for kind in named), fall, odds)


def asked(begun, monkeypatch, candidates, singles=(), pairs=()):
    """What is hopeful if free runs over every window say this."""
    monkeypatch.setattr(PATH, lambda *_: (list(singles), list(pairs)))
    return select_candidates(Screening(tuple(candidates), (), FREE), *begun)


def kinds_of(found):
    return [c.effect.kind for c in found]


def test_what_free_runs_ask_for_comes_first_and_the_likeliest_follow(begun, monkeypatch):
    likely = [
        candidate("cubic_stiffness", 100.0),
        candidate("quadratic_damping", 90.0),
        candidate("backlash", 80.0),  # the third that is likely
        candidate("contact_stop", 20.0),  # below a quarter of the best
        candidate("quadratic_stiffness", 9.0),  # below any interest
        candidate("coulomb_friction", 200.0, remark="its force has the wrong sign"),
    ]
    large = [evident(0.6, "bouc_wen_hysteresis"), evident(0.05, "lugre_friction")]
    found = asked(begun, monkeypatch, likely, large)
    assert kinds_of(found.first) == ["bouc_wen_hysteresis", "cubic_stiffness", "quadratic_damping"]
    assert kinds_of(found.further) == ["backlash", "contact_stop"]
    assert found.pairs == []
    assert found.first[0].fall == 0.6
    assert found.first[0].score == 0.0  # it was no finalist


def test_where_the_likeliest_are_of_one_kind_another_is_asked_too(begun, monkeypatch):
    """Of two wrong gains one explains what the other does, and both may stand for a third."""
    gains = [ScreenedEffect(Effect("sensor_gain", y), 100.0, 0.5) for y in ("x", "v")]
    others = [candidate("cubic_stiffness", 60.0), candidate("quadratic_damping", 50.0)]
    found = asked(begun, monkeypatch, [*gains, *others])
    assert kinds_of(found.first) == ["sensor_gain", "sensor_gain", "cubic_stiffness"]
    few = asked(begun, monkeypatch, [*gains, candidate("cubic_stiffness", 20.0)])
    assert kinds_of(few.first) == ["sensor_gain", "sensor_gain"]  # below a quarter of the best


def test_only_what_takes_away_nearly_as_much_as_the_best_is_large(begun, monkeypatch):
    likely = [candidate("cubic_stiffness", 100.0)]
    for fall, refitted in ((0.49, True), (0.47, False)):  # leaves 1.3 times 40 % at most
        singles = [evident(0.6, "contact_stop"), evident(fall, "quadratic_damping")]
        found = asked(begun, monkeypatch, likely, singles)
        assert ("quadratic_damping" in kinds_of(found.first)) == refitted
    few = [evident(0.6, kind) for kind in (
        "contact_stop", "quadratic_damping", "quadratic_stiffness", "coulomb_friction",
    )]  # fmt: skip
    found = asked(begun, monkeypatch, likely, few)
    assert kinds_of(found.first) == [*kinds_of_evidence(few[:3]), "cubic_stiffness"]


def kinds_of_evidence(found):
    return [e.effects[0].kind for e in found]


def test_nothing_is_refitted_twice(begun, monkeypatch):
    likely = [candidate("cubic_stiffness", 100.0), candidate("quadratic_damping", 90.0)]
    found = asked(begun, monkeypatch, likely, [evident(0.6, "cubic_stiffness")])
    assert kinds_of(found.first) == ["cubic_stiffness", "quadratic_damping"]
    assert found.first[0].score == 100.0
    assert found.further == []


def test_a_pair_has_to_do_visibly_more_than_each_alone(begun, monkeypatch):
    likely = [candidate("cubic_stiffness", 100.0)]
    singles = [evident(0.1, "coulomb_friction"), evident(0.3, "contact_stop")]
    couples = [
        evident(0.5, "coulomb_friction", "quadratic_damping"),
        evident(0.43, "contact_stop", "coulomb_friction"),  # 0.57 > 0.8 * 0.7
        evident(0.45, "contact_stop", "quadratic_damping"),
    ]
    found = asked(begun, monkeypatch, likely, singles, couples)
    pairs = [{c.effect.kind for c in pair} for pair in found.pairs]
    assert {"coulomb_friction", "quadratic_damping"} in pairs
    assert {"contact_stop", "quadratic_damping"} in pairs
    assert len(pairs) == 2  # though every window asks for them again


def test_lines_of_the_motion_are_not_refitted(monkeypatch):
    model = oscillator(inputs=[])
    time = np.arange(2000) / 500.0
    x = 1e-3 * np.exp(-0.5 * time) * np.cos(20 * time)
    data = record(2000).drop_vars("F").assign(x=("time", x))
    prepared = prepared_of(model, data)
    stage = fit_own_parameters(model, prepared).stage.fit

    def hum(hertz):
        return Effect("harmonic_force", "x", {"amplitude": 1.0, "frequency": hertz})

    for hertz, kept in ((20 / (2 * np.pi), False), (9.0, True)):
        found = Evidence((), (hum(hertz),), 0.6, 100.0)
        monkeypatch.setattr(PATH, lambda *_, found=found: ([found], []))
        likely = (candidate("cubic_stiffness", 100.0), ScreenedEffect(hum(hertz), 200.0, 0.5))
        chosen = select_candidates(Screening(likely, (), FREE), stage, prepared)
        assert ("harmonic_force" in kinds_of(chosen.first)) == kept
        assert "cubic_stiffness" in kinds_of(chosen.first)
        # only where nothing else helps
        assert ("harmonic_force" in kinds_of(chosen.further)) == (not kept)


def test_a_missing_spring_is_hopeful():
    prepared = prepared_of(oscillator(), record(3000, cubic=4e5, noise=3e-3))
    stage = fit_own_parameters(oscillator(), prepared).stage
    allowed = [Effect(k, PLACE) for k in ("cubic_stiffness", "backlash", "quadratic_damping")]
    found = select_candidates(screen(stage.model, prepared, allowed), stage.fit, prepared)
    assert found.first[0].place == ("cubic_stiffness", PLACE)
    assert found.first[0].effect.values["stiffness"] == pytest.approx(4e5, rel=0.25)


def test_rivals_are_the_other_kinds_of_a_family_at_its_place(begun):
    stage, prepared = begun
    friction = Effect("coulomb_friction", PLACE, {"force": 0.1})
    found = family_alternatives(friction, stage, prepared, Screening((), (), FREE))
    assert {c.effect.kind for c in found} <= {
        "stribeck_friction", "elastic_coulomb_friction", "dahl_friction", "lugre_friction",
        "bouc_wen_hysteresis",
    }  # fmt: skip
    assert all(c.effect.at == PLACE for c in found)
    assert len({c.effect.kind for c in found}) == len(found)
    alone = Effect("harmonic_force", "x", {"amplitude": 1.0, "frequency": 9.0})
    assert "harmonic_force" not in kinds_of(
        family_alternatives(alone, stage, prepared, Screening((), (), FREE))
    )


def test_what_is_barred_is_left_out_everywhere(begun, monkeypatch):
    likely = [candidate("cubic_stiffness", 100.0), candidate("quadratic_damping", 90.0)]
    pair = evident(0.9, "cubic_stiffness", "coulomb_friction")
    large = [evident(0.6, "cubic_stiffness")]
    found = asked(begun, monkeypatch, likely, large, [pair])
    assert "cubic_stiffness" in kinds_of(found.first)
    assert len(found.pairs) == len(found.seen) > 0
    left = found.without([("cubic_stiffness", PLACE)])
    assert kinds_of(left.first) == ["quadratic_damping"]
    assert not left.pairs
    assert not left.seen


def test_of_what_makes_an_input_late_the_likelier_takes_one_of_the_few_places(begun, monkeypatch):
    late = [candidate("input_lag", 100.0), candidate("input_delay", 90.0)]
    others = [candidate("cubic_stiffness", 80.0), candidate("backlash", 40.0)]
    for likely in ([*late, *others], [*late[::-1], *others]):
        found = asked(begun, monkeypatch, likely)
        assert kinds_of([*found.first, *found.further]) == [
            "input_lag", "cubic_stiffness", "backlash"
        ]  # fmt: skip
