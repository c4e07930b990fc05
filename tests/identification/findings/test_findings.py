from dataclasses import replace

from robustpolish.identification.diagnosis.findings import Ledger
from tests import made_up


def test_the_noise_floor_is_that_of_the_ledger():
    quiet = replace(made_up.diagnosis(), ledger=Ledger(noise_floor={"x": 0.25, "y": 0.5}))
    assert quiet.noise_floor == {"x": 0.25, "y": 0.5}
