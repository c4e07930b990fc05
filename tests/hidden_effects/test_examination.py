"""Hidden effects are found, and the examination that says so is sound.

A few kinds of case each time, all of them in the long tests; diagnoses and rows that nobody
computed show whether the judge judges.
"""

import json
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.identification.findings import FoundEffect, IndistinguishablePair, Value
from tests.hidden_effects import rows
from tests.hidden_effects.cases import Case, axes, model_of, one, records, two
from tests.hidden_effects.catalogue import all_cases
from tests.hidden_effects.drawn import JUDGED_SEED, drawn_cases
from tests.hidden_effects.figures import figures, law_learned
from tests.hidden_effects.intervals import effect_numbers
from tests.hidden_effects.judge import judge, marks
from tests.hidden_effects.kept import KEPT, keep, kept_rows, key_of
from tests.hidden_effects.motion import motion
from tests.hidden_effects.page import page
from tests.hidden_effects.rows import empty_row, run_case, told
from tests.hidden_effects.run import drawn_several, run_all
from tests.hidden_effects.several import (
    LEAST_LEFT,
    LEAST_OVER_NOISE,
    LEAST_SHARE,
    SEEN_SEED,
    UNSEEN_SEED,
    several_case,
    several_cases,
)
from tests.hidden_effects.visible import change_without, sound

# Made-up diagnoses and rows.


def found(kind, at, **numbers):
    """An effect with numbers and standard errors of a hundredth of them."""
    parameters = {name: Value(x, abs(x) / 100, "") for name, x in numbers.items()}
    return FoundEffect(kind, at, parameters)


def diagnosis_of(case, effects=(), verdict="missing_effect", alike=(), **more):
    """A diagnosis of a case that says what it is told to say."""
    return SimpleNamespace(
        verdict=verdict,
        effects=tuple(effects),
        indistinguishable=tuple(
            IndistinguishablePair(rp.effects.Effect(*first), rp.effects.Effect(*second), "")
            for first, second in alike
        ),
        **{"model": model_of(case), "parameters": {}, "noise_floor": {}, "laws": (), **more},
    )


def row_of(case, right, **more):
    """A row about a case."""
    return {**empty_row(case), "verdict": case.verdict, "right": right, "ratio": 1.0, **more}


# The examination: a few cases, and in the long tests all of them.

CASES = {case.name: case for case in all_cases()}
# At least this share of the drawn cases is right. Of the 44 of the judged seed 35 were when they
# were first run as a whole: 80 %. The margin is two cases, because a decision that is nearly a draw
# may fall the other way on another machine. A 45th case came when learned laws did; it adds nothing
# to the floor.
DRAWN_FLOOR = 33 / 45
QUICK = ("quadratic damping", "input delay", "gyroscopic")


@pytest.mark.parametrize(
    "name",
    ["wrong numbers, two masses, in motion", *QUICK],
)
def test_quick_cases_are_named_right(name):
    row = run_case(replace(CASES[name], samples=5000))
    assert row["right"], row
    assert row["ratio"] <= 1.3


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_nine_of_ten_are_named_right_and_extrapolate():
    rows = run_all(list(CASES.values()), KEPT)
    named = [row["right"] for row, case in rows if case.verdict == "missing_effect"]
    assert sum(named) >= 0.9 * len(named), wrong(rows)
    calm = [
        row["ratio"] <= 1.3
        for row, case in rows
        if case.verdict == "missing_effect" and not case.chaotic
    ]
    assert sum(calm) >= 0.9 * len(calm), [(row["case"], row["ratio"]) for row, _ in rows]
    assert all(row["right"] for row, case in rows if case.verdict != "missing_effect"), wrong(rows)
    laws = [row for row, case in rows if case.verdict == "unknown_law"]
    assert len(laws) == 4
    assert all(map(law_learned, laws)), [(r["case"], r["ratio"], r["curves"]) for r in laws]


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_of_the_drawn_cases_as_many_are_right_as_ever():
    rows = run_all(drawn_cases(JUDGED_SEED), KEPT)
    assert sum(row["right"] for row, _ in rows) >= DRAWN_FLOOR * len(rows), wrong(rows)


@pytest.mark.long
@pytest.mark.timeout(6 * 3600)
@pytest.mark.parametrize("seed", [SEEN_SEED, UNSEEN_SEED])
def test_cases_with_several_effects_come_out_as_promised(seed):
    rows = run_all(drawn_several(seed), KEPT)
    found = figures(rows)
    assert found.right.value >= 0.95, wrong(rows)
    assert found.confident.value <= 0.02, [row for row, _ in rows if row["wrong"]]
    assert found.quiet.value >= 0.98, [row for row, case in rows if not case.effects]
    assert 0.90 <= found.covered.value <= 0.99, found.covered
    assert found.floors.value >= 0.95, [(row["case"], row["floors"]) for row, _ in rows]


def wrong(rows):
    return [row for row, _ in rows if not row["right"]]


def test_the_cases_cover_the_catalogue():
    kinds = {kind for case in CASES.values() for kind, _, _ in case.effects}
    assert len(CASES) >= 40
    assert {
        "coulomb_friction", "stribeck_friction", "elastic_coulomb_friction", "lugre_friction",
        "quadratic_damping", "displacement_dependent_damping", "bouc_wen_hysteresis",
        "cubic_stiffness", "quadratic_stiffness", "backlash", "contact_stop", "pendulum_gravity",
        "constant_force", "harmonic_force", "unbalance", "parametric_stiffness",
        "gyroscopic_coupling", "cross_stiffness", "attached_resonator", "input_delay",
        "input_gain", "sensor_offset", "sensor_gain", "input_lag", "maxwell_element",
        "input_saturation", "input_dead_zone",
    } <= kinds  # fmt: skip
    assert len({case.seed for case in CASES.values()}) == len(CASES)


# The plan of a hundred cases with several effects.


@pytest.mark.parametrize("i", [0, 22, 19, 60, 80])
def test_every_effect_shows(i):
    case = several_case(i)
    assert sound(case)
    for k in range(len(case.effects)):
        change = change_without(case, k)
        assert change.over_noise >= LEAST_OVER_NOISE
        assert change.share >= LEAST_SHARE
        assert change.left >= LEAST_LEFT


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_the_whole_plan_is_as_mixed_as_promised():
    cases = several_cases()
    assert len({case.name for case in cases}) == 100
    excitations = Counter(case.excitation for case in cases)
    assert set(excitations) == {"noise", "multisine", "sweep", "none", "blow"}
    assert 25 <= excitations["none"] + excitations["blow"] <= 42
    assert 30 <= sum(bool(case.wrong) for case in cases) <= 50
    assert {len(case.machine.names) for case in cases} == {1, 2, 3}
    mixed = [len({quantity for _, quantity in case.machine.measured}) > 1 for case in cases]
    assert sum(mixed) >= 40
    assert all(len(c.machine.measured) >= min(2, len(c.machine.names)) for c in cases)
    noise = np.array([case.noise_db for case in cases])
    assert 20 <= noise.min() < 25
    assert 55 < noise.max() <= 60


# Visibility of effects beside springs and dampers.

X = ("x", "ground")


def case_of(kind, p, machine=None, **more):
    return Case(kind, machine or one(), [(kind, X, p)], samples=2500, drive=10, **more)


def test_what_a_damper_does_as_well_is_not_left():
    drag = change_without(case_of("power_damping", [3.0, 1.0]), 0)
    assert drag.share > 0.2
    assert drag.left < 0.05


def test_what_breaks_loose_or_sticks_is_not_sound():
    assert sound(case_of("cubic_stiffness", [4e6]))
    assert not sound(case_of("cubic_stiffness", [-4e7]))  # it leaves its well
    assert not sound(case_of("coulomb_friction", [200.0, 0.1]))  # it sticks
    whirling = Case("whirl", axes(), [("cross_stiffness", ("x", "y"), [2e3, -2e3])], samples=2500)
    assert not sound(whirling)


# The integrator: delayed and saturated forces.


@pytest.mark.parametrize("held", [False, True])
def test_a_delay_of_whole_samples_is_a_shift_of_the_force(held):
    machine = one()
    late = Case("delay", machine, [("input_delay", ("F_x",), [4 * machine.dt])], samples=500)
    late = replace(late, warm_up=0, held=held)
    force = np.random.default_rng(0).standard_normal((500, 1))
    force[:5] = force[0]
    shifted = np.vstack([force[:1].repeat(4, axis=0), force[:-4]])
    found = motion(late, inputs=force)
    wanted = motion(replace(late, effects=[]), inputs=shifted)
    scale = np.abs(wanted.acceleration).max()
    np.testing.assert_allclose(found.acceleration[:-1], wanted.acceleration[:-1], atol=1e-9 * scale)
    assert (found.inputs == force).all()


@pytest.mark.parametrize(
    ("kind", "number", "acting"),
    [
        ("input_saturation", 6.0, lambda u: np.clip(u, -6.0, 6.0)),
        ("input_dead_zone", 2.0, lambda u: u - np.clip(u, -2.0, 2.0)),
    ],
)
def test_a_held_actuator_acts_as_its_samples_do(kind, number, acting):
    case = Case(kind, one(), [(kind, ("F_x",), [number])], samples=1500, drive=10)
    case = replace(case, warm_up=0, held=True)
    asked = motion(case).inputs
    plain = motion(replace(case, effects=[]), inputs=acting(asked))
    np.testing.assert_allclose(motion(case).displacement, plain.displacement, rtol=1e-6, atol=1e-9)


# The judge.

G = "ground"
CUBIC, DRY = ("cubic_stiffness", ("x", "x_m"), [1.0]), ("coulomb_friction", ("x", G), [1.0, 0.1])
CASE = Case("both", two(), [CUBIC, DRY])
BOTH = (found("cubic_stiffness", ("x_m", "x")), found("coulomb_friction", ("x", G)))
STRIBECK = found("stribeck_friction", ("x", G))
TWINS = (("coulomb_friction", ("x", G)), ("stribeck_friction", ("x", G)))


@pytest.mark.parametrize("verdict", ["missing_effect", "partly_explained"])
def test_right_names_are_right_whichever_end_comes_first(verdict):
    said = diagnosis_of(CASE, BOTH, verdict)
    assert judge(CASE, said)
    assert marks(CASE, said) == (2, 0, 0, (), 0)


@pytest.mark.parametrize("pair", [TWINS, TWINS[::-1]])
def test_what_is_told_alike_counts(pair):
    said = diagnosis_of(CASE, (BOTH[0], STRIBECK), alike=[pair])
    assert judge(CASE, said)
    assert marks(CASE, said) == (1, 1, 0, (), 0)


def test_one_too_many_is_not_right_even_if_it_is_told_alike():
    said = diagnosis_of(CASE, (*BOTH, STRIBECK), alike=[TWINS])
    assert not judge(CASE, said)
    assert marks(CASE, said) == (2, 0, 0, (), 1)


def law(at):
    return found("learned_stiffness_11", at)


def test_a_law_has_to_be_learned_at_its_place():
    case = Case("fifth", two(), [("fifth_power_stiffness", ("x", G), [1.0])], "unknown_law")
    assert judge(case, diagnosis_of(case, [law(("x", G))], "unknown_law"))
    assert not judge(case, diagnosis_of(case, [law(("x_m", G))], "unknown_law"))
    assert not judge(case, diagnosis_of(case, [], "unexplained"))
    assert not judge(case, diagnosis_of(case, [found("cubic_stiffness", ("x", G))]))
    named = [law(("x", G)), found("coulomb_friction", ("x", G))]
    assert not judge(case, diagnosis_of(case, named, "unknown_law"))


def test_where_there_is_no_static_law_no_name_may_be_given():
    case = Case("breath", one(), [("fading_damping", ("x", G), [1.0, 9.0])], "unexplained")
    for verdict in ("unexplained", "partly_explained", "unknown_law"):
        assert judge(case, diagnosis_of(case, [], verdict))
        assert judge(case, diagnosis_of(case, [law(("x", G))], verdict))
        assert not judge(case, diagnosis_of(case, [found("backlash", ("x", G))], verdict))
    assert not judge(case, diagnosis_of(case, [], "parameters"))


# True values of effect parameters in the terms of the package.


def stated_numbers(case, *effects, **more):
    return {
        s.name.partition(".")[2]: s
        for s in effect_numbers(case, diagnosis_of(case, effects, **more))
    }


@pytest.mark.parametrize(
    ("kind", "at", "size", "names"),
    [
        ("harmonic_force", ("x",), 5.0, ("amplitude", "frequency", "phase")),
        ("unbalance", ("x", "y"), 0.002, ("unbalance", "phase")),
        ("parametric_stiffness", X, 400.0, ("amplitude", "phase")),
    ],
)
def test_phases_are_those_at_the_first_sample(kind, at, size, names):
    case = Case(kind, axes(), [(kind, at, [size, 2 * np.pi * 9.0, 0.7])], warm_up=300, samples=2000)
    told = stated_numbers(case, found(kind, at, **dict.fromkeys(names, 1.0)))
    assert_moves_alike(
        case, rp.effects.Effect(kind, at, {name: s.truth for name, s in told.items()})
    )


def assert_moves_alike(case, effect):
    """The package's model with these numbers moves as the integrator does."""
    (data, _), _ = records(case)
    moved = motion(case)
    begin = np.concatenate([moved.displacement[0], moved.velocity[0]])
    model = model_of(case).with_effect(effect.kind, effect.at, effect.parameters)
    run = rp.simulation.simulate_model(model, data, begin).outputs
    assert np.max(np.abs(run - moved.displacement)) < 1e-3 * np.max(np.abs(run))


# Rows of results.

CUBIC_CASE = Case("cubic", one(), [("cubic_stiffness", X, [4e6])], samples=1500, drive=8)


def test_what_is_told_of_a_case_is_plain():
    (data, noise), _ = records(CUBIC_CASE)
    alike = [(("cubic_stiffness", X), ("backlash", X))]
    said = diagnosis_of(CUBIC_CASE, [found("cubic_stiffness", X, stiffness=4.1e6)], alike=alike,
                        noise_floor={"x": 0.03})  # fmt: skip
    row = empty_row(CUBIC_CASE) | told(CUBIC_CASE, data, noise, said)
    assert json.loads(json.dumps(row | {"ratio": 1.0})) == row | {"ratio": 1.0}
    assert row["right"]
    assert row["found"] == row["truth"] == "cubic_stiffness at x, ground"
    assert row["alike"] == "cubic_stiffness at x, ground / backlash at x, ground"
    assert row["numbers"] == [["cubic_stiffness.stiffness", 4e6, 4.1e6, 4.1e4]]
    assert (row["exact"], row["missed"], row["wrong"], row["named"]) == (1, 0, [], 1)


def test_a_failure_is_a_result(monkeypatch):
    def refuse(model, data):
        raise ValueError("no such luck")

    monkeypatch.setattr(rows, "diagnose", refuse)
    row = run_case(CUBIC_CASE)
    assert (row["verdict"], row["right"], row["missed"]) == ("error", False, 1)
    assert row["found"] == "ValueError: no such luck"
    assert row["seconds"] >= 0


# Rows on file.

FIRST_CASES = all_cases()[:2]


def test_a_row_comes_back_and_a_broken_line_is_left_out(tmp_path):
    file = tmp_path / "rows.jsonl"
    assert kept_rows(file) == kept_rows(None) == {}
    row = row_of(FIRST_CASES[0], True, numbers=[["a", 1.0, 1.1, 0.1]])
    keep(file, FIRST_CASES[0], row)
    with file.open("a", encoding="utf-8") as out:
        out.write('{"key": "cut o')
    assert kept_rows(file) == {key_of(FIRST_CASES[0]): row}
    keep(None, FIRST_CASES[0], row)


# The page.


def test_several_effects_are_told_by_number():
    told = [
        (True, {"exact": 1, "missed": 0, "numbers": [["input_gain.gain", 1, 1.1, 0.1]]}),
        (False, {"exact": 1, "missed": 1, "wrong": ["backlash at m1"], "named": 2}),
        (True, {"exact": 2, "swapped": 1, "missed": 0}),
        (True, {}),
    ]
    several = [several_case(i) for i in (19, 60, 80, 90)]
    rows = [
        (row_of(case, right, **more), case)
        for case, (right, more) in zip(several, told, strict=True)
    ]
    listed, drawn = (
        [(row_of(case, True), case) for case in cases]
        for cases in (all_cases(), drawn_cases(JUDGED_SEED))
    )
    lines = page(listed, drawn, rows, []).splitlines()
    assert any(line.startswith(f"4 cases of seed {UNSEEN_SEED}") for line in lines)
    assert "| kind and place right, or indistinguishable | 3 of 4 (75.0 %) | 95 % |" in lines
    assert "| a wrong name, not indistinguishable | 1 of 4 (25.0 %) | at most 2 % |" in lines
    assert "| nothing named where nothing is missing | 1 of 1 (100.0 %) | 98 % |" in lines
    assert "| two effects | 1 | 0 | 2 | 1 | 0 | 1 | 1 |" in lines
    assert "| three effects | 1 | 1 | 3 | 2 | 1 | 0 | 0 |" in lines
    assert "| input_gain.gain | 1 of 1 (100.0 %) | 1.00 |" in lines
    after = lines[lines.index("Those that are not right:") :]
    assert [line.split(" | ")[0] for line in after if "**no**" in line] == ["| two #60"]
