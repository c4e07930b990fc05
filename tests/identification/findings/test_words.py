import json
from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.diagnosis.findings import FoundEffect, Ledger, Value
from robustpolish.identification.diagnosis.words import explain, headline, plain
from robustpolish.machines.effects.effect import lookup
from tests import made_up


def test_the_effects_are_the_headline():
    found = made_up.diagnosis()
    assert headline(found) == "The model lacked: Coulomb friction at x, ground."
    gain = FoundEffect("input_gain", ("F",), {"gain": Value(1.2, 0.01, "1")})
    both = replace(found, effects=(*found.effects, gain))
    assert headline(both).startswith("The model lacked: Coulomb friction at x, ground and ")
    assert headline(both).endswith(f"{lookup('input_gain').title} at F.")
    part = replace(found, verdict="partly_explained")
    assert headline(part) == f"{headline(found)} And something else is missing."


def test_the_headline_says_that_far_more_than_noise_is_left():
    found = made_up.diagnosis()
    loud, quiet = (
        replace(found, ledger=Ledger(noise_floor={"x": floor}).add("base", {"x": 0.5}))
        for floor in (0.1, 0.3)
    )
    assert headline(loud) == f"{headline(quiet)} Far more than noise is left."
    part = replace(loud, verdict="partly_explained")
    assert headline(part) == f"{headline(quiet)} And something else is missing."


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("adequate", "is noise"),
        ("parameters", "numbers were wrong"),
        ("unexplained", "no effect of the catalogue"),
        ("missing_effect", "lacks a physical effect"),
        ("partly_explained", "a part of the error is left"),
    ],
)
def test_every_verdict_is_a_sentence(verdict, said):
    assert said in headline(replace(made_up.diagnosis(), verdict=verdict, effects=()))


def test_it_says_what_was_found_why_and_what_to_check():
    text = " ".join(explain(made_up.diagnosis()).split())  # lines are folded
    kind = lookup("coulomb_friction")
    for part in (
        "The effects explain 99 % of the error above the noise.",
        "1. Coulomb friction at x, ground",
        "force = 3.100 +- 0.020 N",
        kind.looks_like,
        *(f"Check: {check}" for check in kind.checks),
        *(f"See {reference}" for reference in kind.references),
        "refit: x 0.31",
        "coulomb_friction: x 0.0123",
        "noise floor: x 0.01",
        "coulomb_friction at x, ground and stribeck_friction at x, ground. Move slowly",
    ):
        assert part in text
    assert "not reproducible" not in text
    assert "not reproducible" in explain(replace(made_up.diagnosis(), reproducible=False))


def test_what_is_not_known_is_null():
    told = json.loads(json.dumps(plain(made_up.diagnosis()), allow_nan=False))
    assert told["parameters"]["spring[0].stiffness"]["stderr"] is None
    assert [c["nrmse_held_out"] for c in told["candidates"]] == [0.02, None]
    assert told["candidates"][1]["remark"] == "not sensible"
    assert told["effects"] == [
        {
            "kind": "coulomb_friction",
            "at": ["x", "ground"],
            "parameters": {"force": {"value": 3.1, "stderr": 0.02, "unit": "N"}},
        }
    ]
    assert [place["kind"] for place in told["indistinguishable"][0]] == [
        "coulomb_friction",
        "stribeck_friction",
    ]
    assert told["free_run_reproducible"] is True
    diverged = replace(
        made_up.diagnosis(), ledger=made_up.diagnosis().ledger.add("wild", {"x": np.inf})
    )
    assert plain(diverged)["ledger"][-1] == {"step": "wild", "nrmse": {"x": None}}
