from dataclasses import FrozenInstanceError, fields

import pytest

import robustpolish as rp
from robustpolish.identification.diagnose import diagnose
from robustpolish.identification.policy import POLICY, Policy


def test_what_follows_from_another_number_is_derived():
    assert Policy().at_noise_floor == 1.25
    assert Policy(visible_fall=0.5).at_noise_floor == 2.0
    assert Policy(visible_fall=0.5).together == 0.25
    assert Policy(finalists=40).further_finalists == 10


def test_windows_are_a_share_of_the_record_and_no_shorter_than_some_samples():
    assert POLICY.window(0) == POLICY.shortest_window
    assert POLICY.window(10_000 * POLICY.windows) == 10_000


def test_short_records_can_afford_more_steps():
    assert POLICY.steps(3999) == 15
    assert POLICY.steps(4000) == 7


def test_two_effects_are_one_to_the_data_within_bounds():
    assert [POLICY.same(held_out) for held_out in (100, 4000, 1_000_000)] == [0.03, 0.01, 0.003]


def test_every_number_has_its_reason():
    told = [
        name
        for line in (Policy.__doc__ or "").splitlines()
        if " : " in line
        for name in line.split(" : ")[0].strip().split(", ")
    ]
    assert {field.name for field in fields(Policy)} <= set(told)


def test_it_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        POLICY.visible_fall = 0.3  # pyright: ignore[reportAttributeAccessIssue]


def test_a_diagnosis_goes_by_the_policy_that_it_is_given():
    model, data = rp.datasets.sticky_slide()
    short = data.isel(time=slice(0, 500))
    assert diagnose(model, short).verdict == "missing_effect"
    found = diagnose(model, short, _policy=Policy(most_effects=0))
    # no name may be given; whether a curve is learned from so short a record is the laws' business,
    # and so is a jump at rest beside it, which no curve could be
    assert found.verdict in {"unknown_law", "unexplained"}
    kinds = {effect.kind for effect in found.effects}
    assert kinds - {"coulomb_friction"} <= {k for k in kinds if k.startswith("learned_")}
    assert kinds != {"coulomb_friction"}
    assert not found.candidates
