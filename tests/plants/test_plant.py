"""Generalised plants: from systems, matrices and files; their parts, loops and names."""

import itertools

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.linear.systems import as_state_space
from robustpolish.plants.linearization import linearize


def random_plant(rng, nx=4, nw=2, nu=3, nz=2, ny=2, dt=0, D22=True):
    """Return a plant of these sizes; all nine matrices are full."""

    def shape(*n):
        return rng.standard_normal(n)

    return rp.GeneralizedPlant.from_matrices(
        shape(nx, nx),
        shape(nx, nw),
        shape(nx, nu),
        shape(nz, nx),
        shape(ny, nx),
        shape(nz, nw),
        shape(nz, nu),
        shape(ny, nw),
        shape(ny, nu) * D22,
        dt=dt,
    )


# The generalised plant: its parts, its changes and its complaints.


def test_state_feedback_loop_ignores_what_is_measured():
    plant = random_plant(np.random.default_rng(2))
    gain = np.random.default_rng(3).standard_normal((3, 4))
    loop = plant.state_feedback_loop(gain)
    np.testing.assert_allclose(loop.A, plant.A + plant.B2 @ gain)
    np.testing.assert_allclose(loop.C, plant.C1 + plant.D12 @ gain)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"measurements": 5}, "measurements: got 5, expected a whole number from 0 to 4"),
        ({"controls": -1}, "controls: got -1"),
        ({"controls": 1.5}, "controls: got 1.5"),
        ({"units": {"nothing": "m"}}, "units: got 'nothing'"),
        ({"system": "1/(s + 1)"}, "system: got '"),
    ],
)
def test_bad_plants_are_named(change, message):
    plant = random_plant(np.random.default_rng(5))
    arguments = {"system": plant.system, "measurements": 2, "controls": 3} | change
    with pytest.raises(InvalidInputError) as caught:
        rp.GeneralizedPlant(**arguments)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": [[1, 2, 3], [4, 5, 6]]}, r"A: got shape \(2, 3\)"),
        ({"B1": [[1.0]]}, r"B1: got shape \(1, 1\)"),
        ({"C2": [[1, np.nan]]}, "C2: got nan at row 0, column 1"),
        ({"B2": [["a"], ["b"]]}, "B2: got"),
        ({"A": np.eye(2) * 1j}, "A: got complex entries"),
        ({"states": ["x", "x"]}, "states: got"),
        ({"states": "xy"}, "states: got 'xy'"),
    ],
)
def test_bad_matrices_are_named(change, message):
    good = {"A": -np.eye(2), "B1": [[1], [0]], "B2": [[0], [1]], "C1": [[1, 0]], "C2": [[0, 1]]}
    with pytest.raises(InvalidInputError, match=message):
        rp.GeneralizedPlant.from_matrices(**(good | change))


def named_plant():
    return random_plant(np.random.default_rng(5)).replace(
        states=["a", "b", "c", "d"],
        disturbances=["F", "G"],
        units={"a": "m", "F": "N", "z1": "m", "y2": "V"},
    )


def test_replaced_names_keep_every_matrix_and_unit():
    plant = named_plant()
    assert plant.system.input_labels == ["F", "G", "u1", "u2", "u3"]
    again = plant.replace(measurements=["one", "y2"], units={"one": "V", "F": "kN"})
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(again.system, name), getattr(plant.system, name))
    assert again.measurement_names == ("one", "y2")
    assert dict(again.units) == {"a": "m", "F": "kN", "z1": "m", "y2": "V", "one": "V"}
    assert (again.states, again.disturbance_names) == (plant.states, ("F", "G"))


def test_replaced_matrices_keep_all_others():
    plant = named_plant()
    wider = np.hstack([plant.B1, plant.B1[:, :1]])
    again = plant.replace(
        B1=wider, D11=np.zeros((2, 3)), D21=np.zeros((2, 3)), disturbances=["F", "G", "H"]
    )
    np.testing.assert_array_equal(again.B1, wider)
    for name in ("A", "B2", "C1", "C2", "D12", "D22"):
        np.testing.assert_array_equal(getattr(again, name), getattr(plant, name))
    assert dict(again.units) == dict(plant.units)
    assert plant.replace(C1=plant.C1 * 2, D11=plant.D11 * 2).performance_names == ("z1", "z2")
    assert plant.replace(dt=0.1).dt == 0.1
    assert plant.replace(dt=0.1).replace(A=np.eye(4)).dt == 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"B1": np.zeros((4, 3))}, "D11"),
        ({"A": np.zeros((3, 3))}, "B1"),
        ({"C1": np.zeros((3, 4)), "D11": np.zeros((3, 2)), "D12": np.zeros((3, 3))}, "performance"),
        ({"disturbances": ["F"]}, "disturbances"),
        ({"units": {"nobody": "m"}}, "nobody"),
    ],
)
def test_bad_replacements_are_named(change, message):
    with pytest.raises(InvalidInputError, match=message):
        named_plant().replace(**change)


def test_an_unknown_argument_is_not_swallowed():
    with pytest.raises(TypeError, match="disturbance_names"):
        named_plant().replace(disturbance_names=["F"])


def test_a_part_has_the_rows_and_columns_of_the_whole():
    plant = named_plant()
    part = plant.part(disturbances=[1], performance=[1, 0], measurements=[], controls=[2, 0])
    assert part.system.input_labels == ["G", "u3", "u1"]
    assert part.system.output_labels == ["z2", "z1"]
    np.testing.assert_array_equal(part.D12, plant.D12[[1, 0]][:, [2, 0]])
    np.testing.assert_array_equal(part.B1, plant.B1[:, [1]])
    assert dict(part.units) == {"a": "m", "z1": "m"}
    alone = plant.part(states=[], disturbances=[0])
    assert (alone.nx, alone.nw, alone.ny) == (0, 1, 2)
    np.testing.assert_array_equal(alone.D11, plant.D11[:, [0]])


# The blocks of a plant, and its loop with u = K y.


@pytest.mark.parametrize("dt", [0, 0.1])
def test_closed_loop_is_the_linear_fractional_transformation(dt):
    rng = np.random.default_rng(1)
    plant = random_plant(rng, dt=dt)
    controller = control.ss(
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)),
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)) * 0.1,
        dt,
    )
    loop = plant.closed_loop(controller)
    for s in (0.3 + 2j, -0.7 + 0.1j, 5.0 + 0j):
        P, K = plant.system(s), controller(s)
        expected = P[:2, :2] + P[:2, 2:] @ K @ np.linalg.solve(np.eye(2) - P[2:, 2:] @ K, P[2:, :2])
        np.testing.assert_allclose(loop(s), expected, rtol=1e-9)


def test_ill_posed_loop_is_refused():
    plant = rp.GeneralizedPlant.from_matrices(-1, 1, 1, 1, 1, D22=2)
    with pytest.raises(InvalidInputError, match="well-posed"):
        plant.closed_loop([[0.5]])


def test_controller_must_fit():
    plant = random_plant(np.random.default_rng(6))
    with pytest.raises(InvalidInputError, match=r"shape \(3, 2\)"):
        plant.closed_loop(np.zeros((2, 3)))
    with pytest.raises(InvalidInputError, match="sampling time"):
        plant.closed_loop(control.ss(0.5, np.ones((1, 2)), np.ones((3, 1)), 0, 0.1))


# Controls and measurements by name and by number.


INS, OUTS = ["F", "d", "n", "V"], ["y", "z", "x"]


def system():
    rng = np.random.default_rng(1)
    matrices = [rng.standard_normal(shape) for shape in ((3, 3), (3, 4), (3, 3), (3, 4))]
    return control.ss(*matrices, inputs=INS, outputs=OUTS, states=["a", "b", "c"])


def test_named_signals_go_last_in_the_order_of_their_names():
    plant = rp.GeneralizedPlant(system(), ["x", "y"], ("V", "F"))
    whole = plant.system
    assert (whole.output_labels, whole.input_labels) == (["z", "x", "y"], ["d", "n", "V", "F"])
    assert (plant.ny, plant.nu) == (2, 2)
    assert whole.state_labels == ["a", "b", "c"]
    point = 1.3j
    old, new = system()(point), whole(point)
    for i, output in enumerate(whole.output_labels):
        for j, given in enumerate(whole.input_labels):
            assert new[i, j] == pytest.approx(old[OUTS.index(output), INS.index(given)])


def test_a_single_name_stands_for_itself_and_units_stay():
    plant = rp.GeneralizedPlant(system(), "y", "F", {"y": "m", "F": "N", "a": "m"})
    assert (plant.measurement_names, plant.control_names) == (("y",), ("F",))
    assert (plant.performance_names, plant.disturbance_names) == (("z", "x"), ("d", "n", "V"))
    assert plant.measurements == plant.controls == 1
    assert plant.units["y"] == "m"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"measurements": "w"}, "measurements: got 'w', expected names among .* y, z, x"),
        ({"measurements": ["y", "y"]}, "measurements: got y, y, with a name twice"),
        ({"controls": ["F", "y"]}, "controls: got 'y', expected names among .* F, d, n, V"),
        ({"controls": [0]}, "controls: got 0, expected names"),
        ({"controls": 5}, "controls: got 5, expected a whole number from 0 to 4"),
        ({"controls": True}, "controls: got True, expected a whole number"),
        ({"controls": None}, "controls: got None"),
        ({"measurements": 1.0}, "measurements: got 1.0"),
        ({"measurements": object}, "measurements: got <class 'object'>"),
    ],
)
def test_what_is_neither_is_refused(change, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.GeneralizedPlant(system(), **({"measurements": "y", "controls": "F"} | change))


# Whatever users call a system.


POINTS = 1j * np.array([0.0, 0.3, 1.7, 20.0])


def test_a_transfer_function_keeps_response_and_names():
    G = control.tf([2.0, 1.0], [1.0, 0.2, 9.0], inputs="F", outputs="x")
    plant = rp.GeneralizedPlant(G, measurements="x", controls="F")
    for s in POINTS:
        assert complex(plant.system(s)) == pytest.approx(complex(G(s)))
    assert (plant.measurement_names, plant.control_names, plant.nx) == (("x",), ("F",), 2)


def test_several_inputs_and_outputs_keep_their_response():
    num = [[[1.0], [2.0, 1.0]], [[3.0], [1.0, 0.0]]]
    den = [[[1.0, 1.0], [1.0, 2.0, 3.0]], [[1.0, 1.0], [1.0, 2.0, 3.0]]]
    G = control.tf(num, den, inputs=["a", "b"], outputs=["p", "q"])
    plant = rp.GeneralizedPlant(G, measurements=["p"], controls=["a"])
    assert (plant.disturbance_names, plant.performance_names) == (("b",), ("q",))
    for s in POINTS:
        np.testing.assert_allclose(plant.system(s), G(s)[::-1, ::-1], atol=1e-12)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "G: got an improper TransferFunction"),
        (control.tf([np.inf], [1.0, 1.0]), "G: got coefficients that are not finite"),
        (control.frd([1.0], [1.0]), "G: got FrequencyResponseData"),
        (control.ss([[np.nan]], [[1.0]], [[1.0]], 0), "G.A: got nan"),
        ("1/(s+1)", "G: got '1/"),
        (None, "G: got None"),
    ],
)
def test_others_are_refused(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        as_state_space("G", given)


def test_no_realisation_is_believed(monkeypatch):
    G = control.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 2.0]]])
    wrong = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])
    monkeypatch.setattr(control, "ss", lambda *_, **__: wrong)
    with pytest.raises(rp.InvalidInputError, match="realisation has another response"):
        as_state_space("G", G)


# A controller may be a system, a transfer function or a gain.


@pytest.fixture
def plant():
    return rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def test_a_transfer_function_closes_the_loop_as_its_realisation_does(plant):
    K = control.tf([-3.0], [1.0, 2.0])
    loop = plant.closed_loop(K)
    assert (loop.input_labels, loop.output_labels) == (["w1"], ["z1"])
    np.testing.assert_allclose(sorted(loop.poles().imag), [-np.sqrt(2.75), np.sqrt(2.75)])
    delayed = plant.with_delay("u1", 0.01).delayed_loop(K)
    assert bool(rp.linear.delay_stability(delayed))


def test_what_does_not_fit_is_named(plant):
    with pytest.raises(InvalidInputError, match="a TransferFunction with 1 outputs and 2 inputs"):
        plant.closed_loop(control.tf([[[1.0], [1.0]]], [[[1.0, 1.0], [1.0, 2.0]]]))
    measured = control.frd([1.0, 2.0], [1.0, 2.0])
    with pytest.raises(InvalidInputError, match="Fit or linearise it first"):
        plant.closed_loop(measured)


# Plants that are known by their frequency response only.


OMEGA = 2 * np.pi * np.linspace(1.0, 5.0, 9)


def response():
    values = np.arange(2 * 3 * OMEGA.size).reshape(2, 3, OMEGA.size) * (1 + 0.5j)
    return control.frd(values, OMEGA, inputs=["F", "d", "e"], outputs=["x", "z"])


def test_signals_are_sorted_by_name_as_of_any_plant():
    plant = rp.GeneralizedPlant(response(), measurements="x", controls="F", units={"x": "m"})
    assert (plant.nw, plant.nu, plant.nz, plant.ny) == (2, 1, 1, 1)
    assert plant.disturbance_names == ("d", "e")
    found = plant.frequency_response([1.0, 3.0, 5.0])
    np.testing.assert_allclose(
        found.sel(output="x", input="F").values, np.asarray(response().frdata)[0, 0, [0, 4, 8]]
    )
    assert "a frequency response" in str(plant)
    assert "states" not in str(plant)


def test_between_the_lines_it_is_straight_and_beyond_them_unknown():
    plant = rp.GeneralizedPlant(response(), 1, 1)
    found = plant.frequency_response([1.25])
    expected = np.asarray(response().frdata)[..., :2].mean(axis=-1)
    for (i, output), (j, name) in itertools.product(enumerate("xz"), enumerate("Fde")):
        assert found.sel(output=output, input=name).item() == pytest.approx(expected[i, j])
    with pytest.raises(rp.InvalidInputError, match=r"frequency: got 0.5 to 0.5 Hz, .* 1 to 5 Hz"):
        plant.frequency_response([0.5])


@pytest.mark.parametrize(
    "call",
    [
        lambda p: p.nx,
        lambda p: p.A,
        lambda p: p.D22,
        lambda p: p.closed_loop([[1.0]]),
        lambda p: p.with_actuator("F", 5.0),
        lambda p: p.save("never.json"),
        lambda p: p.part(disturbances=[0]),
        lambda p: rp.output_feedback(p),
        lambda p: rp.mixed_sensitivity(p, 1.0),
        lambda p: rp.loop_shaping(p),
        lambda p: rp.certify(p, [[1.0]]),
    ],
)
def test_what_needs_states_refuses_it(call):
    plant = rp.GeneralizedPlant(response(), "x", "F")
    with pytest.raises(rp.InvalidInputError, match="plant: got a frequency response, which has no"):
        call(plant)


# Linear models of nonlinear ones near an equilibrium.


def duffing(q, u):
    position, speed = q
    return [speed, -4.0 * position - position**3 - 0.1 * speed + u[0]]


def test_equilibrium_and_jacobian_of_a_duffing_oscillator():
    """At rest under u = 5 the position is 1, where the stiffness is 4 + 3."""
    answer = linearize(
        duffing, [0.8, 0.1], [5.0], states=["q", "dq"], inputs=["F"], outputs=["a", "b"]
    )
    np.testing.assert_allclose(answer.state, [1, 0], atol=1e-10)
    np.testing.assert_allclose(answer.system.A, [[0, 1], [-7, -0.1]], atol=1e-8)
    np.testing.assert_allclose(answer.system.B, [[0], [1]], atol=1e-8)
    assert answer.system.state_labels == ["q", "dq"]


def test_output_map():
    answer = linearize(duffing, [1, 0], [5.0], output=lambda q, u: [q[0] ** 2, u[0] * q[1]])
    np.testing.assert_allclose(answer.system.C, [[2, 0], [0, 5]], atol=1e-8)
    np.testing.assert_allclose(answer.system.D, [[0], [0]], atol=1e-8)


def test_small_states_need_their_scale():
    """sin(q / 1e-9) has its slope at the scale of nanometres."""
    answer = linearize(lambda q, u: u - np.sin(q / 1e-9), [1e-12], [0.0], scale=[1e-9, 1.0])
    np.testing.assert_allclose(answer.system.A, [[-1e9]], rtol=1e-8)


def test_a_point_that_is_no_equilibrium_is_refused():
    with pytest.raises(InvalidInputError, match="state: got a state with relative residual"):
        linearize(duffing, [1, 0], [0.0], find_equilibrium=False)


def test_a_model_without_equilibrium_is_refused():
    with pytest.raises((SolverError, InvalidInputError), match="state:"):
        linearize(lambda q, u: np.exp(q) + u, [0.0], [1.0])


def test_bad_shapes_are_named():
    with pytest.raises(InvalidInputError, match="dynamics: got a result of shape"):
        linearize(lambda q, u: [1.0], [0.0, 0.0])
    with pytest.raises(InvalidInputError, match="scale: got"):
        linearize(duffing, [1, 0], [5.0], scale=[1.0])
    with pytest.raises(InvalidInputError, match="control_value: got"):
        linearize(lambda q, u: -q, [0.0])
