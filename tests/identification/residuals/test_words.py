import json

import numpy as np
import pytest

from robustpolish.identification.residuals.analysis import explain, to_dict
from tests.identification.residuals.made_up import figures, table


def lines(**changes):
    return [line.strip() for line in explain(figures(**changes)).splitlines()]


def test_it_says_where_most_of_the_error_is():
    said = lines()
    assert said[:3] == [
        "Where the error is:",
        "x: 25 % of the error, NRMSE 0.02",
        "y: 75 % of the error, NRMSE 0.0346",
    ]
    assert "time: most in 2 to 4 s, 60 % of the error" in said
    assert "frequency: most in 10 to 50 Hz, 55 %, which holds the mode at 20 Hz" in said
    assert "near the mode at 20 Hz: 30 %" in said
    assert not any("mode at 5 Hz" in line for line in said)  # 3 % is no news
    assert "displacement of x near 2 m: 85 % of the error in 10.0 % of the samples" in said
    assert not any("velocity" in line or "contact" in line or "phase" in line for line in said)


@pytest.mark.parametrize(
    ("share", "said"),
    [([0.7, 0.1, 0.1, 0.1], "most near 45 deg, 70 % of the error"), ([0.25] * 4, "evenly spread")],
)
def test_it_says_at_which_phase_of_the_spin(share, said):
    phase = np.pi / 4 * np.array([1, 3, 5, 7])
    assert f"spin phase: {said}" in lines(phase=table("phase", share, share, phase=phase))


def test_it_says_how_much_is_in_contact():
    contact = table(
        "state", [1.0, 0.0], [0.6, 0.4], state=["contact", "flight"], samples=[0.2, 0.8]
    )
    said = "contact: 70 % of the error in 20 % of the samples; the rest in free flight"
    assert said in lines(contact=contact)


def test_it_gives_the_tests():
    said = lines()
    assert "autocorrelation of x: 50.0 % of the lags outside, largest -0.70" in said
    assert said[-1] == (
        "F with y: correlation outside at 50.0 % of the lags, "
        "coherence above chance at 25.0 % of the frequencies"
    )


def test_the_numbers_are_plain():
    told = json.loads(json.dumps(to_dict(figures())))
    assert told["windows"] == {
        "output": ["x", "y"],
        "begin": [0.0, 2.0],
        "end": [2.0, 4.0],
        "share": [[1.0, 0.0], [0.2, 0.8]],
    }
    assert told["phase"] is told["contact"] is None
    assert told["places"]["x"]["displacement"]["samples"] == [0.9, 0.1]
    assert told["cross_correlation"] == [
        {"input": "F", "output": "y", "flagged_share": 0.5, "largest": -0.7, "coherent_share": 0.25}
    ]
