import numpy as np
import pytest
import xarray as xr

from robustpolish.identification.fit.prepared import fit_and_held_out_parts
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.parts import Input
from robustpolish.machines.simulation.run import simulate_model as simulate
from tests.identification.oscillators import PLACE, RATE, oscillator, record


def sides_of(model, data):
    return fit_and_held_out_parts(model, record_of(model, data))


def ranges(parts):
    return [(part.first, part.first + part.samples) for part in parts]


def loud(times, samples=1000):
    """A record so many times as large."""
    return record(samples, noise=0.01).map(lambda values: times * values)


def names(parts):
    return [part.name for part in parts]


def test_of_records_that_move_alike_a_third_is_held_out():
    """Nobody judges where nothing was seen, nor is anything left unjudged where alone it shows."""
    sizes = {"a": 10, "b": 1, "c": 12, "d": 1.3, "e": 15, "f": 1.2}
    data = {name: loud(times) for name, times in sizes.items()}
    kept, judges = sides_of(oscillator(), data)
    assert names(judges) == ["c", "f"]
    assert names(kept) == ["a", "b", "d", "e"]
    assert all(part.samples == 1000 for part in [*kept, *judges])


def test_the_longer_half_of_a_pair_is_fitted_to():
    pair = [loud(1, 1000), loud(1.5, 700)]
    assert names(sides_of(oscillator(), pair)[1]) == ["record 2"]
    uneven = [loud(1, 1000), loud(1.5, 300), loud(1.7, 300)]
    assert names(sides_of(oscillator(), uneven)[1]) == ["record 2"]


def test_what_has_not_its_like_is_cut_into_blocks():
    """Of the amplitude, or of the place of a blow."""
    kept, judges = sides_of(oscillator(), [loud(1), loud(30), loud(1.2), loud(6)])
    assert names(judges) == ["record 1", *["record 2"] * 2, *["record 4"] * 2]
    assert names(kept) == [*["record 2"] * 2, "record 3", *["record 4"] * 2]
    two = oscillator(inputs=[Input("F", PLACE), Input("G", PLACE)])
    one, again, other = (loud(t).assign(G=loud(0)["F"]) for t in (1, 1.1, 1.2))
    other = other.assign(F=other["G"], G=other["F"])
    judges = sides_of(two, [one, other, again])[1]
    assert names(judges) == ["record 1", "record 2", "record 2"]


def test_two_records_are_cut_by_their_motion():
    """Of a blow that has died out half-way nothing is judged in the quiet half alone."""
    model, time = oscillator(damping=4.0), np.arange(3000) / RATE
    pulse = np.exp(-(((time - 0.3) / 0.01) ** 2))
    data = xr.Dataset({"F": ("time", 50 * pulse)}, {"time": time})
    x = simulate(model, data).outputs[:, 0]
    x = x + 1e-5 * np.random.default_rng(0).standard_normal(x.size)
    blow = data.assign(x=("time", x))
    kept, judges = sides_of(model, [blow, blow.map(lambda values: 0.1 * values)])
    assert names(judges) == ["record 1"] * 2 + ["record 2"] * 2
    for part, judge in zip(kept, judges, strict=True):
        assert judge.follows(part)
    assert np.std(judges[0].Y) > 0.3 * np.std(x)
    alone = sides_of(model, blow)[1]
    assert [(a.first, a.samples) for a in alone] == [(b.first, b.samples) for b in judges[:2]]


def test_a_sweep_is_judged_where_it_passes_its_resonance():
    model, time = oscillator(damping=0.5), np.arange(6000) / RATE
    force = np.sin(2 * np.pi * (1.0 + 0.5 * time) * time)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    x = simulate(model, data).outputs[:, 0]
    kept, judges = sides_of(model, data.assign(x=("time", x)))
    for some in (kept, judges):
        assert max(np.max(np.abs(part.Y)) for part in some) > 0.5 * np.max(np.abs(x))


def test_a_free_decay_is_cut_by_time():
    """Its end is quiet, and shows alone what is small there."""
    time = np.arange(3000) / RATE
    x = np.exp(-time) * np.cos(20 * time)
    judges = sides_of(oscillator(inputs=[]), xr.Dataset({"x": ("time", x)}, {"time": time}))[1]
    assert ranges(judges) == [(1050, 1950), (2700, 3000)]
    steady = sides_of(oscillator(), [loud(1), loud(3)])[1]
    assert ranges(steady)[0] == pytest.approx((400, 550), abs=120)


def test_a_decay_that_is_over_early_is_judged_where_it_moves():
    time = np.arange(3000) / RATE
    x = np.exp(-2.5 * time) * np.cos(20 * time)
    assert np.max(np.abs(x[1050:])) < 0.03
    decay = xr.Dataset({"x": ("time", x)}, {"time": time})
    judges = sides_of(oscillator(inputs=[]), decay)[1]
    assert np.max(np.abs(judges[0].Y)) > 0.3
    assert judges[-1].first + judges[-1].samples == 3000


def test_blocks_too_short_for_a_fit_are_cut_by_time():
    """Where nearly all of the motion is in a few samples."""
    time = np.arange(2000) / RATE
    x = np.exp(-50 * time) * np.cos(20 * time)
    decay = xr.Dataset({"x": ("time", x)}, {"time": time})
    judges = sides_of(oscillator(inputs=[]), [decay, 5 * decay])[1]
    assert ranges(judges) == [(700, 1300), (1800, 2000), (2700, 3300), (3800, 4000)]
