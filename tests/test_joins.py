"""What one public function returns, every public function that could take it takes."""

import control
import hypothesis
import numpy as np
import pandas as pd
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from scipy import signal

import robustpolish as rp
from robustpolish.implementation import certify_sampled, emulated, plant_at_samples
from robustpolish.linear import prescale, scale_system, stability, zeros_on_axis
from robustpolish.linear.response import linear_response
from robustpolish.linear.systems import as_state_space

# One system, G = 3 (s + 4)/((s + 1)(s^2 + s + 9)), in all forms; and held at samples.
ZEROS, POLES, GAIN = [-4.0], [-1.0, *np.roots([1, 1, 9])], 3.0
NUM, DEN = GAIN * np.poly(ZEROS), np.poly(POLES)
SS = control.ss(control.tf(NUM, DEN), inputs="u", outputs="y")
HELD = control.c2d(SS, 0.1)
HELD_TF = control.tf(HELD)
SYSTEMS = {
    "tf": control.tf(NUM, DEN),
    "zpk": control.zpk(ZEROS, POLES, GAIN),
    "interconnection": control.interconnect([SS.copy("G")], inputs="u", outputs="y"),
    "scipy ss": signal.StateSpace(SS.A, SS.B, SS.C, SS.D),
    "scipy tf": signal.TransferFunction(NUM, DEN),
    "scipy zpk": signal.ZerosPolesGain(ZEROS, POLES, GAIN),
    "series of known systems": rp.uncertain.series(SS, 1.0),
    "uncertain at a value": rp.feedback(SS, rp.uncertain.real("k", 2.0, percent=50)).at({"k": 0.0}),
    "known feedback": rp.feedback(SS, 0.0),
    "discrete tf": HELD_TF,
    "scipy discrete ss": signal.StateSpace(HELD.A, HELD.B, HELD.C, HELD.D, dt=0.1),
    "scipy discrete tf": signal.TransferFunction(HELD_TF.num[0][0], HELD_TF.den[0][0], dt=0.1),
    "scipy discrete zpk": signal.ZerosPolesGain(
        HELD.zeros(), HELD.poles(), HELD_TF.num_list[0][0][0], dt=0.1
    ),
    "plant at samples": plant_at_samples(rp.GeneralizedPlant(SS, 1, 1), 0.1),
    "emulated": emulated(SS, 0.1, "zoh"),
}
TIME = np.arange(30) * 0.1
STATIC = control.ss([], [], [], [[-0.1]])


def certified(K):
    if getattr(K, "dt", 0):
        plant = rp.GeneralizedPlant.from_matrices([[0.5]], [[1]], [[1]], [[1]], [[1]], dt=0.1)
    else:
        plant = rp.GeneralizedPlant.from_matrices([[-9.0]], [[1]], [[1]], [[1]], [[1]])
    return rp.certify(plant, K).achieved


def simulated(G):
    names = as_state_space("G", G)
    found = rp.simulate(G, {"time": TIME, names.input_labels[0]: np.ones(30)})
    return found[names.output_labels[0]].to_numpy()


FUNCTIONS = {
    "hinf_norm": lambda G: rp.hinf_norm(G).value,
    "h2_norm": lambda G: rp.h2_norm(G).value,
    "modes": lambda G: rp.modes(G).natural_frequencies_hz,
    "stability": lambda G: stability(G).margin,
    "singular_values": lambda G: rp.linear.singular_values(G, [0.0, 0.7]).values,
    "controllability": lambda G: len(rp.linear.controllability(G).modes),
    "observability": lambda G: len(rp.linear.observability(G).modes),
    "zeros_on_axis": lambda G: len(zeros_on_axis(G)),
    "prescale": lambda G: prescale(G).system.nstates,
    "scale_system": lambda G: scale_system(G)[0].nstates,
    "linear_response": lambda G: linear_response(G, TIME, np.ones((30, 1))).outputs[1:],
    "loop_analysis": lambda G: rp.loop_analysis(G, -0.1).modulus_margin,
    "GeneralizedPlant": lambda G: rp.hinf_norm(rp.GeneralizedPlant(G, 1, 1).system).value,
    "from_loop": lambda G: rp.GeneralizedPlant.from_loop(G).nx,
    "feedback": lambda G: rp.hinf_norm(rp.feedback(G, 0.1)).value,
    "series": lambda G: rp.hinf_norm(rp.uncertain.series(G, 2.0)).value,
    "structured_singular_value": lambda G: rp.hinf_norm(rp.uncertain.append(G, G)).value,
    "certify": certified,
    "simulate": lambda G: simulated(G)[1:],
    "emulated": lambda G: rp.hinf_norm(G if getattr(G, "dt", 0) else emulated(G, 0.1)).value,
}


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_every_function_takes_every_system(name, function):
    G = SYSTEMS[name]
    like = HELD if getattr(G, "dt", 0) else SS
    want, got = FUNCTIONS[function](like), FUNCTIONS[function](G)
    np.testing.assert_allclose(got, want, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("function", ["hinf_norm", "modes", "loop_analysis", "GeneralizedPlant"])
def test_what_is_uncertain_or_measured_is_refused_by_name(function):
    uncertain = rp.feedback(SS, rp.uncertain.real("k", 2.0, percent=50))
    with pytest.raises(rp.InvalidInputError, match=r"uncertain k.*nominal"):
        FUNCTIONS[function](uncertain)
    for wrong in ("text", None, object()):
        with pytest.raises(rp.InvalidInputError, match="expected"):
            FUNCTIONS[function](wrong)
    if function in ("hinf_norm", "modes"):
        with pytest.raises(rp.InvalidInputError, match="loop_analysis"):
            FUNCTIONS[function](control.frd([1, 2, 3], [1.0, 2.0, 3.0]))


def test_a_machine_is_a_system():
    place = ("x", "ground")
    machine = rp.MechanicalModel(
        [rp.Dof("x", 2.0)], [rp.Spring(place, 50.0)], [rp.Damper(place, 1.0)],
        [rp.Input("F", place)], [rp.Output("x", place)],
    )  # fmt: skip
    system = machine.state_space()
    for function in ("hinf_norm", "h2_norm", "modes", "loop_analysis", "GeneralizedPlant"):
        assert np.all(FUNCTIONS[function](machine) == FUNCTIONS[function](system))


def test_measured_responses_go_from_function_to_function():
    f = np.geomspace(0.01, 10, 200)
    H = control.frd(SS, 2 * np.pi * f)
    read = rp.read_frequency_response(H)
    wants = rp.loop_analysis(H, -1).phase_margin
    for given in (read, rp.GeneralizedPlant(read, 1, 1), rp.GeneralizedPlant(read, "y", "u")):
        assert rp.loop_analysis(given, -1).phase_margin == pytest.approx(wants, rel=1e-12)
    np.testing.assert_array_equal(rp.read_frequency_response(read), read)


def test_designs_are_controllers():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    design = rp.given_controller(plant, [[-3.0]])
    assert rp.certify(plant, design).achieved == design.certificate.achieved
    assert rp.given_controller(plant, design).certificate.achieved == pytest.approx(0.5)
    sampled = design.discretize(0.1)
    bound = certify_sampled(plant, sampled).bound
    assert bound == sampled.certificate.bound
    assert certify_sampled(plant, control.tf([-3.0], [1.0], 0.1)).bound == pytest.approx(bound)
    assert certify_sampled(plant, signal.dlti([-3.0], [1.0], dt=0.1)).bound == pytest.approx(bound)


x, F = np.cos(TIME), np.sin(TIME)
TABLES = {
    "mapping": {"time [s]": TIME, "x [m]": x, "F [N]": F},
    "lists": {"time": list(TIME), "x [m]": list(x), "F [N]": list(F)},
    "with a rate": {"fs": 10.0, "x [m]": x, "F [N]": F},
    "fields": np.rec.fromarrays([TIME, x, F], names="time,x,F"),
    "frame": pd.DataFrame({"time [s]": TIME, "x [m]": x, "F [N]": F}),
    "control": control.TimeResponseData(
        TIME, x, None, F, output_labels=["x"], input_labels=["F"], issiso=True
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_every_table_is_a_record(name):
    data = rp.read_measurement(TABLES[name])
    for found, want in (("time", TIME), ("x", x), ("F", F)):
        np.testing.assert_allclose(data[found], want, atol=1e-12)
    place = ("x", "ground")
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)], [rp.Spring(place, 9.0)], [rp.Damper(place, 1.0)],
        [rp.Input("F", place)], [rp.Output("x", place)],
    )  # fmt: skip
    want = rp.compare(model, TABLES["frame"]).nrmse
    assert rp.compare(model, TABLES[name]).nrmse == pytest.approx(want, rel=1e-9)


PLANT = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
DESIGN = rp.given_controller(PLANT, [[-3.0]])
# What functions return, and where the systems are that it holds: the reason of a refusal names it.
RESULTS = {
    "plant": (PLANT, ".system"),
    "design": (DESIGN, ".closed_loop or .controller"),
    "sampled design": (DESIGN.discretize(0.1), ".controller"),
    "delayed loop": (PLANT.with_delay("u1", 0.1).delayed_loop([[-3.0]]), ".system or .pade_model"),
    "analysis": (rp.loop_analysis(DESIGN), ""),
    "certificate": (DESIGN.certificate, ""),
    "record": (rp.read_measurement(TABLES["frame"]), ""),
    "response": (linear_response(SS, TIME, np.ones((30, 1))), ""),
    "modes": (rp.modes(SS), ""),
}


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("name", RESULTS)
def test_every_function_takes_every_result_or_says_why_not(name, function):
    value, parts = RESULTS[name]
    refused = ""
    try:
        FUNCTIONS[function](value)
    except rp.InvalidInputError as error:
        refused = str(error)
    assert not refused or "expected" in refused
    if function in ("hinf_norm", "modes", "stability", "prescale"):
        assert refused
        assert parts in refused


@pytest.mark.parametrize("name", ["mapping", "frame", "with a rate", "fields", "control"])
def test_every_table_is_a_disturbance(name):
    force = TABLES[name]
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)], [rp.Spring(("x", "ground"), 9.0)], [rp.Damper(("x", "ground"), 1.0)],
        [rp.Input("F", ("x", "ground"))], [rp.Output("x", ("x", "ground"))],
    )  # fmt: skip
    plant = rp.GeneralizedPlant(model.state_space(), 0, 0)
    if name in ("fields", "control"):
        force = rp.read_measurement(force)
    want = linear_response(model, TIME, F[:, None]).outputs[:, 0]
    np.testing.assert_allclose(rp.simulate(plant, force)["x"], want, atol=1e-9)


def with_sensor(G):
    plant = rp.GeneralizedPlant(G, 1, 1)
    return plant.with_filter(plant.measurement_names[0], 3.0).system


# Chains of three calls on any system, against the response that they must have.
LINKS = {
    "prescaled": (lambda G: prescale(G).system, lambda g: g),
    "in a loop": (lambda G: rp.feedback(G, 0.1), lambda g: g / (1 + 0.1 * g)),
    "in series": (lambda G: rp.uncertain.series(G, 2.0), lambda g: 2 * g),
    "in parallel": (lambda G: rp.uncertain.parallel(G, 0.5), lambda g: g + 0.5),
    "a plant's": (lambda G: rp.GeneralizedPlant(G, 1, 1).system, lambda g: g),
    "with a sensor": (with_sensor, lambda g: 3 * g),
}


@settings(max_examples=60)
@hypothesis.given(
    st.sampled_from(sorted(SYSTEMS)),
    st.lists(st.sampled_from(sorted(LINKS)), min_size=3, max_size=3),
)
def test_chains_of_three_calls_have_the_response_of_their_formula(name, chain):
    G = SYSTEMS[name]
    hertz = np.array([0.01, 0.4, 2.0])
    like = HELD if getattr(G, "dt", 0) else SS
    points = 2j * np.pi * hertz
    want = like(np.exp(0.1 * points) if like is HELD else points)
    for link in chain:
        G, want = LINKS[link][0](G), LINKS[link][1](want)
    got = rp.linear.singular_values(G, hertz).isel(singular_value=0)
    np.testing.assert_allclose(got, np.abs(want), rtol=1e-6)
