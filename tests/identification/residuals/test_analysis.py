"""The analysis finds the error where it was put."""

import json

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.identification.residuals.analysis import residual_analysis
from robustpolish.machines.mechanical.parts import Damper
from tests.identification.residuals.two_masses import (
    RANDOM,
    SAMPLES,
    TIME,
    analyse,
    model,
    record,
)


def test_rows_of_shares_add_up_to_one():
    result = analyse(record(), contact=RANDOM.random(SAMPLES) < 0.5)
    tables = [result.windows, result.bands, result.phase, result.contact]
    for place in result.places.values():
        tables += [place.displacement, place.velocity]
    for table in tables:
        np.testing.assert_allclose(table.sum(table.dims[1]), 1.0)
        assert float(result.overall(table).sum()) == pytest.approx(1.0)
    assert float(result.channels.sum()) == pytest.approx(1.0)


def test_noise_alone_is_evenly_spread():
    result = analyse(record())
    share = result.overall(result.windows)
    assert float(share.max()) < 2 / share.size
    assert all(0.003 < test.flagged_share < 0.02 for test in result.autocorrelation.values())
    for test in result.cross_correlation.values():
        assert test.flagged_share < 0.03


def test_the_channel():
    result = analyse(record(b=1e-5 * np.sin(700 * TIME)))
    assert float(result.channels.sel(output="b")) > 0.95


def test_the_time():
    burst = 1e-4 * np.sin(900 * TIME) * ((TIME > 1.0) & (TIME < 1.2))
    share = analyse(record(a=burst)).windows.sel(output="a")
    worst = int(np.argmax(share.values))
    assert float(share["begin"][worst]) == pytest.approx(1.0, abs=1e-3)
    assert float(share[worst]) > 0.9


def test_the_frequency_and_the_spin_harmonic():
    result = analyse(record(a=1e-4 * np.sin(2 * np.pi * 62 * TIME)))
    share = result.bands.sel(output="a")
    worst = int(np.argmax(share.values))
    assert float(share["low"][worst]) < 62 < float(share["high"][worst])
    harmonics = result.harmonics.sel(output="a")
    np.testing.assert_allclose(harmonics["frequency"], 31 * np.arange(1, 6))
    assert float(harmonics[1]) > 0.8
    assert float(harmonics[3]) < 0.1


def test_the_mode():
    result = analyse(
        record(model(dampers=[Damper(("a", "ground"), 8.0), Damper(("a", "b"), 30.0)]))
    )
    assert float(result.overall(result.modes).max()) > 0.3


def test_the_spin_phase():
    result = analyse(record(a=1e-4 * (np.mod(31 * TIME, 1) < 0.1)))
    share = result.phase.sel(output="a")
    assert float(share.sel(phase=slice(0, 0.1 * 2 * np.pi)).sum()) > 0.6
    mean = result.phase["mean"].sel(output="a")
    assert float(mean[0]) > float(mean[12]) + 5e-5


def test_contact_and_flight():
    touches = (np.mod(TIME, 0.5) < 0.1).astype(float)
    error = 1e-4 * touches * RANDOM.standard_normal(SAMPLES)
    result = analyse(record(a=error, contact=touches))
    assert float(result.contact.sel(output="a", state="contact")) > 0.9
    assert float(result.contact["samples"][0]) == pytest.approx(0.2, abs=0.01)
    named = analyse(record(a=error, gate=touches), contact="gate")
    assert float(named.contact.sel(output="a", state="contact")) > 0.9
    assert analyse(record()).contact is None


def test_predictions_begin_later():
    result = residual_analysis(compare(model(), record(), horizon=0.05))
    assert result.residual.sizes["time"] == SAMPLES - 100


def test_refused():
    data = record()
    with pytest.raises(InvalidInputError, match="contact"):
        analyse(data, contact="gate")
    with pytest.raises(InvalidInputError, match="contact"):
        analyse(data, contact=np.zeros(3, bool))
    with pytest.raises(InvalidInputError, match="64"):
        analyse(data.isel(time=slice(0, 40)))
    wild = model(dampers=[Damper(("a", "ground"), -5e3), Damper(("b", "ground"), -5e3)])
    with pytest.raises(InvalidInputError, match="diverge"):
        residual_analysis(compare(wild, data))


def test_words_numbers_and_pictures():
    result = analyse(record(a=1e-4 * np.sin(2 * np.pi * 62 * TIME)))
    text = result.explain()
    assert repr(result).split() == text.replace(": ", " ").split()
    for part in ("Where the error is", "a: ", "spin harmonic at 62 Hz", "autocorrelation of b"):
        assert part in text
    numbers = json.loads(json.dumps(result.to_dict()))
    assert numbers["autocorrelation"]["a"]["flagged_share"] > 0.02
    # windows, bands, one autocorrelation, one input twice, three places with colour bars
    assert len([ax for ax in result.plot_panels().axes if ax.get_title()]) == 6
