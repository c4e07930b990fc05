import numpy as np
import pytest
import xarray as xr
from scipy.linalg import solve_discrete_are

from robustpolish.identification.observer.kalman import (
    FREE,
    Level,
    displacement_amplitude,
    displacement_peak,
    excited_bandwidth,
    force_sites,
    observer_gain,
    riccati,
    scales_of,
    white_noise,
    with_missing_force,
)
from robustpolish.identification.record import record_of
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Dof, Input, Output, Spring
from robustpolish.machines.simulation.run import build_system
from tests.identification.oscillators import PLACE, RATE, oscillator, record, rig

TIME = np.arange(8000) / RATE


def gain_at(level, model=None):
    model = model or oscillator()
    scales = scales_of(model, record_of(model, record(noise=0.01)))
    system = with_missing_force(model, build_system(model, 1 / RATE), scales.leak)
    return system, observer_gain(system, 1 / RATE, level, scales)


def seen(quantity, signal):
    """A record of a force that does not matter, and one output of some quantity."""
    model = oscillator(outputs=[Output("y", PLACE, quantity)])
    data = xr.Dataset({"F": ("time", np.zeros(TIME.size)), "y": ("time", signal)}, {"time": TIME})
    return model, record_of(model, data)


def test_scales_of_several_records_are_those_of_one():
    """The jump from record to record is no motion; the quietest record shows the noise best."""
    one, other = record(4000, noise=0.01), record(3000, (0.1, 0.0), noise=0.01, seed=1)
    alone = scales_of(oscillator(), record_of(oscillator(), one))
    both = scales_of(oscillator(), record_of(oscillator(), [one, other, one]))
    assert both.bandwidth == pytest.approx(alone.bandwidth, rel=0.1)
    noise = 0.01 * np.std(record(4000)["x"].values)
    assert both.noise[0] == pytest.approx(noise, rel=0.3)
    loud = one.assign(x=one["x"] + np.random.default_rng(0).standard_normal(4000))
    assert scales_of(oscillator(), record_of(oscillator(), [loud, one])).noise[0] == alone.noise[0]


@pytest.mark.parametrize("units", [1.0, 1e-9])
def test_the_riccati_equation_is_solved(units):
    """Against SciPy's solver in ordinary units; in odd ones the solution scales with them."""
    random = np.random.default_rng(1)
    F, C = random.standard_normal((5, 5)) / 2, random.standard_normal((2, 5))
    root = random.standard_normal((7, 7))
    joint = root @ root.T  # of noise on the states and on the outputs
    Q, N, R = joint[:5, :5], joint[:5, 5:], joint[5:, 5:]
    expected = solve_discrete_are(F.T, C.T, Q, R, s=N)
    T = np.diag([1.0, units, 1.0, 1 / units, 1.0])
    F, C = T @ F @ np.linalg.inv(T), units * C @ np.linalg.inv(T)
    found = riccati(F, C, T @ Q @ T, units**2 * R, units * T @ N)
    np.testing.assert_allclose(found, T @ expected @ T, rtol=1e-6)


def test_a_missing_force_pushes_like_an_input():
    """3 N hold a spring of 400 N/m at 7.5 mm; without a leak they stay for ever."""
    model = oscillator(outputs=[Output("x", PLACE), Output("a", PLACE, "acceleration")])
    system = with_missing_force(model, build_system(model, 1 / RATE), 0.0)
    held = np.array([3 / 400, 0.0, 3.0])
    np.testing.assert_allclose(system.A @ held, 0.0, atol=1e-12)
    np.testing.assert_allclose(system.C @ held, [3 / 400, 0.0], atol=1e-12)
    leaking = with_missing_force(model, build_system(model, 1 / RATE), 2.0)
    assert leaking.A[2, 2] == -2.0


def test_the_observer_forgets_and_follows_the_more_the_higher_its_level():
    followed = []
    for level in (Level(0.01), Level(1.0), Level(0.0, 0.1)):
        system, gain = gain_at(level)
        expm = np.linalg.matrix_power(np.eye(3) + system.A / RATE / 1024, 1024)
        assert np.max(np.abs(np.linalg.eigvals(expm - gain.predictor @ system.C))) < 1
        followed.append(gain.filter[0, 0])
    assert 0 < followed[0] < followed[1] < 1


def test_a_free_run_is_not_corrected():
    assert FREE.free
    assert not Level(0.0, 0.1).free
    gain = gain_at(FREE)[1]
    assert not gain.filter.any()
    assert not gain.predictor.any()


def test_forces_may_be_missing_where_something_is_free_or_a_force_is_measured():
    rows, pairs = force_sites(oscillator(dofs=[Dof("x", 1.0), Dof("y", 1.0)],
                                         springs=[Spring(("x", "y"), 1.0)]))  # fmt: skip
    assert pairs == [("x", "ground"), ("y", "ground")]
    np.testing.assert_array_equal(rows, np.eye(2))
    rows, pairs = force_sites(rig())
    assert pairs == [PLACE]
    driven = MechanicalModel(
        [Dof("x", 1.0)],
        inputs=[Input("x", PLACE, "displacement")],
        outputs=[Output("f", ("x",), "force", drive=True)],
    )
    assert force_sites(driven)[1] == [PLACE]


def test_white_noise_is_seen_beneath_a_signal():
    swing = 50 * np.sin(2 * np.pi * 3.1 * TIME)
    noise = 0.2 * np.random.default_rng(0).standard_normal(TIME.size)
    assert white_noise(swing + noise, 1 / RATE) == pytest.approx(0.2, rel=0.1)
    assert white_noise(np.full(1000, 7.0), 1 / RATE) == 1.0


def test_the_bandwidth_is_that_of_the_displacement():
    """Two lines of one size: in an acceleration the faster one is next to no motion."""
    lines = np.sin(2 * np.pi * 5 * TIME) + np.sin(2 * np.pi * 50 * TIME)
    line = 2 * np.pi * RATE / 2048  # of the spectrum; a window smears over two
    for quantity, hertz in (("displacement", 50), ("acceleration", 5)):
        found = excited_bandwidth(*seen(quantity, lines))
        assert found == pytest.approx(2 * np.pi * hertz, abs=2 * line)
    still = excited_bandwidth(*seen("displacement", np.ones(TIME.size)))
    assert still == pytest.approx(0.2 * RATE)


def test_the_amplitude_is_that_of_a_displacement():
    swing = 3.0 + 0.02 * np.sin(2 * np.pi * TIME)
    assert displacement_amplitude(*seen("displacement", swing), 10.0) == pytest.approx(
        0.02, rel=0.01
    )
    assert displacement_amplitude(*seen("velocity", swing), 10.0) == pytest.approx(0.002, rel=0.01)
    assert displacement_amplitude(*seen("acceleration", swing), 10.0) == pytest.approx(
        0.0002, rel=0.01
    )
    data = xr.Dataset(
        {name: ("time", 0.5 * np.sin(2 * np.pi * TIME)) for name in "xvf"}, coords={"time": TIME}
    )
    assert displacement_amplitude(rig(), record_of(rig(), data), 10.0) == pytest.approx(
        0.5, rel=0.01
    )


def test_sizes_scale_with_their_units():
    model, data = oscillator(), record(noise=0.01)
    plain = scales_of(model, record_of(model, data))
    small = scales_of(model, record_of(model, data.assign({n: 1e-6 * data[n] for n in ("F", "x")})))
    assert plain.force[0] == pytest.approx(float(np.sqrt(np.mean(data["F"] ** 2))))
    assert plain.noise[0] == pytest.approx(0.01 * float(data["x"].std()), rel=0.15)
    for name in ("noise", "force", "inputs"):
        np.testing.assert_allclose(getattr(small, name), 1e-6 * getattr(plain, name))
    assert small.bandwidth == plain.bandwidth


def test_a_voltage_is_no_amplitude():
    data = record()
    data = data.assign(u=("time", np.full(data.time.size, 5.0), {"units": "V"}))
    model = oscillator()
    read = model.with_channel("u", "V")
    one, other = (displacement_amplitude(m, record_of(m, data), 40.0) for m in (model, read))
    assert one == other < 5.0


def test_the_peak_is_what_outputs_or_an_observer_show_but_no_spike_or_drift():
    decay = 0.02 * np.exp(-TIME) * np.cos(20 * TIME)
    usual, largest = (
        of(*seen("displacement", decay), 10.0) for of in (displacement_amplitude, displacement_peak)
    )
    assert largest == pytest.approx(0.02, rel=0.01)
    assert 1.5 * usual < largest
    seen_by_observer = np.array([[0.0, -0.03, 0.01]])
    assert displacement_peak(*seen("displacement", decay), 10.0, seen_by_observer) == pytest.approx(
        0.03
    )
    drifted = displacement_peak(*seen("displacement", decay), 10.0, 100 * seen_by_observer)
    assert drifted == pytest.approx(4 * usual)


def test_a_machine_without_inputs_swings_no_slower_than_its_slowest_mode():
    """What creeps behind a law that nearly holds it is no motion to go by."""
    creep = xr.Dataset({"x": ("time", 0.02 * np.exp(-0.5 * TIME))}, {"time": TIME})
    free = oscillator(inputs=[])
    natural = np.abs(np.linalg.eigvals(free.matrices.first_order()[0]))[0]
    assert excited_bandwidth(free, record_of(free, creep)) == pytest.approx(natural)
    driven = creep.assign(F=("time", np.zeros(TIME.size)))
    assert excited_bandwidth(oscillator(), record_of(oscillator(), driven)) < natural / 2
