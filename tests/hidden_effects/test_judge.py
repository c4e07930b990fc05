"""Right, alike, missed, and wrong with confidence: on diagnoses that nobody computed."""

import pytest

from tests.hidden_effects.cases import Case, one, two
from tests.hidden_effects.judge import judge, marks
from tests.hidden_effects.made_up import diagnosis_of, found

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


def test_names_without_a_verdict_that_stands_by_them_are_not():
    assert not judge(CASE, diagnosis_of(CASE, BOTH, "unexplained"))


@pytest.mark.parametrize("pair", [TWINS, TWINS[::-1]])
def test_what_is_told_alike_counts(pair):
    said = diagnosis_of(CASE, (BOTH[0], STRIBECK), alike=[pair])
    assert judge(CASE, said)
    assert marks(CASE, said) == (1, 1, 0, (), 0)


def test_another_kind_is_a_confident_wrong_name():
    said = diagnosis_of(CASE, (BOTH[0], STRIBECK))
    assert not judge(CASE, said)
    assert marks(CASE, said) == (1, 0, 1, ("stribeck_friction at x",), 0)


def test_another_place_is_a_confident_wrong_name():
    said = diagnosis_of(CASE, (BOTH[0], found("coulomb_friction", ("x_m", G))))
    assert marks(CASE, said).wrong == ("coulomb_friction at x_m",)


def test_a_part_of_the_truth_is_not_right_and_not_wrong_with_confidence():
    said = diagnosis_of(CASE, BOTH[:1], "partly_explained")
    assert not judge(CASE, said)
    assert marks(CASE, said) == (1, 0, 1, (), 0)


def test_one_too_many_is_not_right_even_if_it_is_told_alike():
    said = diagnosis_of(CASE, (*BOTH, STRIBECK), alike=[TWINS])
    assert not judge(CASE, said)
    assert marks(CASE, said) == (2, 0, 0, (), 1)


def test_one_pair_excuses_one_name():
    case = Case("two of a kind", two(), [DRY, ("coulomb_friction", ("x_m", G), [1.0, 0.1])])
    said = diagnosis_of(case, (STRIBECK, found("stribeck_friction", ("x_m", G))), alike=[TWINS])
    assert marks(case, said) == (0, 1, 1, ("stribeck_friction at x_m",), 0)


def test_a_name_where_nothing_is_missing_is_wrong():
    case = Case("nothing", one(), verdict="parameters")
    assert judge(case, diagnosis_of(case, verdict="parameters"))
    assert not judge(case, diagnosis_of(case, verdict="adequate"))
    said = diagnosis_of(case, [STRIBECK])
    assert not judge(case, said)
    assert marks(case, said).wrong == ("stribeck_friction at x",)


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


def test_friction_beside_a_law_may_have_its_name():
    effects = [("dead_zone_spring", ("x", G), [1.0, 0.1]), DRY]
    case = Case("dead zone", two(), effects, "unknown_law")
    said = diagnosis_of(case, [law(("x", G)), found("coulomb_friction", ("x", G))], "unknown_law")
    assert judge(case, said)


def test_where_there_is_no_static_law_no_name_may_be_given():
    case = Case("breath", one(), [("fading_damping", ("x", G), [1.0, 9.0])], "unexplained")
    for verdict in ("unexplained", "partly_explained", "unknown_law"):
        assert judge(case, diagnosis_of(case, [], verdict))
        assert judge(case, diagnosis_of(case, [law(("x", G))], verdict))
        assert not judge(case, diagnosis_of(case, [found("backlash", ("x", G))], verdict))
    assert not judge(case, diagnosis_of(case, [], "parameters"))


def test_a_law_in_place_of_a_name_is_not_right():
    case = Case("cubic", one(), [("cubic_stiffness", ("x", G), [1.0])])
    said = diagnosis_of(case, [law(("x", G))], "unknown_law")
    assert not judge(case, said)
    assert marks(case, said) == (0, 0, 1, (), 0)
