"""The printed controllers against the norms that they really achieve."""

import tomllib

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.thesis.comparison import PUBLISHED_CONTROLLERS, published_gain


@pytest.mark.parametrize(
    ("name", "norm"),
    [
        ("first", 3.3626e-6),
        ("first_scaled", 3.3611e-6),
        ("second", 1.45745e-5),
        ("second_scaled", 3.84298e-5),
        ("first_h2", 1.709e-7),
        ("first_h2_scaled", 1.024e-8),
    ],
)
def test_all_stabilise_and_none_has_its_printed_norm(name, norm):
    """Reading: n = 0.001, k_A = 1e9 N/m, bearing of 1.337 kg."""
    actuation = "displacement" if name.startswith("first") else "force"
    found = rp.hinf_norm(
        rp.air_bearing(actuation=actuation).state_feedback_loop(published_gain(name))
    )
    assert found.stable
    assert found.value == pytest.approx(norm, rel=4e-4 if "h2" in name else 1e-5)


@pytest.mark.shared
def test_every_entry_is_the_printed_one(shared):
    printed = tomllib.loads((shared / "thesis" / "published.toml").read_text())
    for name in PUBLISHED_CONTROLLERS:
        gain = published_gain(name)
        if name.endswith("_scaled"):
            gain = gain / printed["scaling"][name.split("_")[0]]
        for i, axis in enumerate("xyz"):
            block = gain[2 * i : 2 * i + 2, 4 * i : 4 * i + 4]
            np.testing.assert_allclose(block, printed["controller"][name][axis], rtol=1e-15)
        assert np.count_nonzero(gain) == 24


def test_unknown_controller():
    with pytest.raises(InvalidInputError, match="name: got 'third'"):
        published_gain("third")
