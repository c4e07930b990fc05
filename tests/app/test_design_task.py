"""What is asked of a controller for a machine: tasks, signals, weights, and the designs."""

from typing import Any

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.app.design_task import asked_weight, machine_plant
from tests.app.machines import DESIGN, SPINDLE, WEIGHTS

MODEL = rp.MechanicalModel.from_toml(SPINDLE)


def test_a_machine_is_wired_as_by_hand():
    task = rp.results.DesignTask(
        MODEL,
        controls=["F"],
        measurements="x",
        actuators={"F": {"bandwidth_hz": 500.0, "limit": 100.0}},
        sensors={"x": {"bandwidth_hz": 2e3, "noise": 1e-9}},
        delays={"F": 1e-4},
    )
    plant = MODEL.linearize(["F"])
    by_hand = plant.part(measurements=[0]).with_actuator("F", 500.0, limit=100.0)
    by_hand = by_hand.with_sensor("measured_x", 2e3, noise=1e-9).with_delay("F", 1e-4)
    np.testing.assert_allclose(task.plant.system.A, by_hand.system.A)
    np.testing.assert_allclose(task.plant.system.D, by_hand.system.D)
    assert dict(task.plant.limits) == {"F": 100.0}
    assert any("Pade" in note for note in task.notes)
    assert "3 states" not in repr(task)


def test_weights_of_mixed_sensitivity_and_of_channels():
    low = {"low": 10.0, "crossover_hz": 5.0, "high": 0.1}
    weights = {"performance": {"x": low}, "effort": 1e-5, "robustness": [None, 0.5]}
    task = rp.results.DesignTask(MODEL, controls=["F"], weights=weights)
    names = task.weighted.performance_names
    assert names == ("performance_measured_x", "effort_F", "robustness_measured_acc")
    own = {"channels": {"F_cut": 3.0, "spindle": low}}
    channels = rp.results.DesignTask(MODEL, controls=["F"], weights=own)
    np.testing.assert_allclose(channels.weighted.B1, 3 * channels.plant.B1[[*range(4), 0]] * [
        [1], [1], [1], [1], [0]])  # fmt: skip
    assert channels.weighted.nx == channels.plant.nx + 1


def test_which_controller_is_meant_and_at_which_price():
    kinds = {
        "output feedback": {"measurements": ["x"]},
        "state feedback": {"measurements": ["slide", "dslide", "spindle", "dspindle"]},
        "order 2": {"order": 2},
    }
    for kind, extra in kinds.items():
        assert rp.results.DesignTask(MODEL, controls=["F"], **extra).kind == kind
    whole = rp.results.DesignTask(MODEL, controls=["F"], full_state=True)
    assert (whole.kind, whole.plant.ny) == ("state feedback", 4)
    heard = rp.results.DesignTask(
        MODEL, controls=["F"], measurement_noise=1e-6, **kinds["state feedback"]
    )
    assert heard.kind == "output feedback"
    model = MODEL.with_effect("cubic_stiffness", ("slide", "ground"), {"stiffness": 1e9})
    task = rp.results.DesignTask(model, controls=["F", "slide"], control_weight={"slide": 2.0})
    assert task.prices is not None
    np.testing.assert_array_equal(task.prices, [0.0, 2.0])
    assert "linearised about the state of rest: cubic_stiffness" in task.notes[0]
    both = rp.read_design_task(task, control_weight=3.0)
    assert both.prices is not None
    np.testing.assert_array_equal(both.prices, [3.0, 3.0])


@pytest.mark.parametrize(
    ("extra", "says"),
    [
        ({"norm": "h3"}, "norm"),
        ({"method": "best"}, "method"),
        ({"order": -1}, "order"),
        ({"order": 2, "method": "lmi"}, "besides an order"),
        ({"full_state": True, "measurements": ["x"]}, "besides full_state"),
        ({"full_state": True, "order": 2}, "besides full_state"),
        ({"full_state": True, "method": "slycot"}, "slycot"),
        ({"full_state": True, "weights": {"effort": 1.0}}, "mixed sensitivity"),
        ({"full_state": True, "delays": {"F": 1e-4}}, "infinitely many states"),
        ({"actuators": {"G": {"bandwidth_hz": 1}}}, "actuators: got 'G'"),
        ({"actuators": {"F": {"bandwidth": 1}}}, r"actuators\.F\.bandwidth.*bandwidth_hz"),
        ({"actuators": {"F": {"bandwidth_hz": -1}}}, r"actuators\.F\.bandwidth_hz"),
        ({"sensors": {"x": {"limit": 1}}}, r"sensors\.x\.limit"),
        ({"sensors": {"x": 1}}, "a table"),
        ({"delays": {"Fx": 1e-3}}, "delays: got 'Fx'"),
        ({"delays": {"F": -1}}, r"delays\.F"),
        ({"weights": {"preformance": 1.0}}, "preformance.*Write performance"),
        ({"weights": {"effort": 1.0, "channels": {}}}, "of mixed sensitivity, or of channels"),
        ({"weights": {"channels": {"F_cat": 1.0}}}, "weights.channels.*F_cut"),
        ({"weights": {"effort": {"G": 2.0}}}, r"weights\.effort"),
        ({"control_weight": {"G": 1.0}}, "control_weight"),
        ({"control_weight": -1.0}, "control_weight"),
        ({"computation_delay": 1e-4}, "without a sampling rate"),
        ({"sample_rate_hz": 0}, "sample_rate_hz"),
        ({"full_state": "yes"}, "true or false"),
        ({"controls": 3}, "names of signals"),
    ],
)
def test_what_cannot_be_asked_for(extra, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.results.DesignTask(MODEL, **{"controls": ["F"], **extra})


def test_a_plant_and_files_keep_their_sections(tmp_path):
    task = rp.read_design_task(SPINDLE + DESIGN)
    assert task.controls == ("F",)
    assert task.plant.limits["F"] == 200.0
    assert task.plant.nx == 6
    changed = rp.read_design_task(SPINDLE + DESIGN, measurements=["x", "acc"], norm="h2")
    assert changed.plant.ny == 2
    assert changed.norm == "h2"
    assert set(rp.read_design_task(SPINDLE + DESIGN + WEIGHTS).weights) == {"performance", "effort"}
    path = tmp_path / "machine.toml"
    model = rp.MechanicalModel.from_toml(SPINDLE + DESIGN + WEIGHTS)
    model.with_parameters({"dof.slide.mass": 13.0}).to_toml(path)
    again = rp.MechanicalModel.from_toml(path)
    assert again.design == model.design
    assert again != model
    assert hash(again.with_parameters({"dof.slide.mass": 12.0})) == hash(model)
    assert rp.read_design_task(path).plant.nx == 6
    kept = '[design]\nfull_state = true\norder = 3\nnames = ["a"]\n'
    assert rp.MechanicalModel.from_toml(SPINDLE + kept).to_toml().endswith(kept)
    rp.air_bearing().save(tmp_path / "plant.json")
    section = tmp_path / "asked.toml"
    section.write_text('[design]\ncontrols = ["x"]\nperformance = ["x"]\n')
    task = rp.read_design_task(tmp_path / "plant.json", section)
    assert task.plant.control_names == ("u_x",)
    assert rp.read_design_task(tmp_path / "plant.json").plant.nu == 6
    section.write_text("[dof.x]\nmass = 1.0\n")
    with pytest.raises(rp.InvalidInputError, match="expected one of design, weights"):
        rp.read_design_task(rp.air_bearing(), section)


SLIPS = [
    ('controls = ["F"]', 'control = ["F"]', r"line 34: design\.control:.*Write controls"),
    ('controls = ["F"]', 'controls = ["G"]', "line 34: controls: got 'G'"),
    ("bandwidth_hz = 1000.0", "bandwith_hz = 1.0", r"line 41: actuators\.F\.bandwith_hz"),
    ("bandwidth_hz = 5000.0", "bandwidth_hz = 0", r"line 44: sensors\.x\.bandwidth_hz"),
    ("crossover_hz = 10.0", "crossover = 10.0", r"line 47: weights\.performance\.crossover"),
    ("low = 20.0", "low = 0.1", r"line 47: weights\.performance\.low"),
    ("[weights]", "[weight]", "weight: got an unknown key.*Write weights"),
    ("control_weight = 1e-6", "control_weight = 1979-05-27", r"design\.control_weight"),
    ("[design.sensors]", "[design.weights]\neffort = 1.0\n[design.sensors]", "Join them"),
    ("measurements", "norm = 3\nmeasurements", "line 35: norm: got 3"),
]


def test_slips_with_their_line_and_what_is_no_machine():
    text = SPINDLE + DESIGN + WEIGHTS
    for old, new, says in SLIPS:
        assert old in text
        with pytest.raises(rp.InvalidInputError, match=says):
            rp.read_design_task(text.replace(old, new, 1))
    for says, machine, changes in (
        (r"nowhere.toml \(No such file", "nowhere.toml", {}),
        (r"nowhere.json \(No such file", "nowhere.json", {}),
        (r"control.*Write controls", rp.air_bearing(), {"control": ["u_x"]}),
        ("a MechanicalModel or a GeneralizedPlant", 3, {}),
    ):
        with pytest.raises(rp.InvalidInputError, match=says):
            rp.read_design_task(machine, **changes)


def test_every_name_finds_its_column_and_row():
    plant = machine_plant(MODEL, ["F"], ["x", "dspindle"], ["spindle", "acc"], ["F_cut", "slide"])
    assert plant.control_names == ("F",)
    assert plant.measurement_names == ("measured_x", "measured_dspindle")
    assert plant.performance_names == ("spindle", "output_acc")
    assert plant.disturbance_names == ("F_cut", "disturbance_slide")
    whole = MODEL.state_space()  # from F_cut, F to x, acc
    for s in (0.0, 300j, 2000j):
        own = np.asarray(plant.system(s))  # from w, u to z, y
        np.testing.assert_allclose(own[1, 0], whole(s)[1, 0], atol=1e-12)
        np.testing.assert_allclose(own[1, 1], whole(s)[1, 1], atol=1e-12)  # F acts on the slide
        np.testing.assert_allclose(own[2, 2], whole(s)[0, 1])
        np.testing.assert_allclose(own[3, 0], s * own[0, 0], atol=1e-12)
    assert plant.units["output_acc"] == "m/s^2"
    assert plant.units["disturbance_slide"] == "N"


def test_what_is_not_named_and_what_is_unknown():
    plant = machine_plant(MODEL, ["F"], (), (), ())
    assert plant.disturbance_names == ("F_cut",)
    assert plant.performance_names == ("slide", "spindle")
    assert plant.measurement_names == ("measured_x", "measured_acc")
    alone = machine_plant(MODEL, ["F", "F_cut"], (), (), ())
    assert alone.disturbance_names == ("disturbance_F", "disturbance_F_cut")
    pushed = machine_plant(MODEL, ["u_slide"], (), (), ())
    assert pushed.control_names == ("u_slide",)
    for names, says in (
        ((["Fcut"], (), (), ()), "controls: got 'Fcut'.*Write F_cut"),
        (((), (), (), ()), "controls: got none"),
        ((["F", "F"], (), (), ()), "F twice"),
        ((["F"], ["acceleration"], (), ()), "got 'acceleration', expected one of x"),
        ((["F"], (), ["spindel"], ()), "performance.*Write spindle"),
        ((["F"], (), (), ["cut"]), "disturbances: got 'cut'"),
    ):
        with pytest.raises(rp.InvalidInputError, match=says):
            machine_plant(MODEL, *names)


def test_a_plant_keeps_what_is_named_and_its_delays():
    given = rp.air_bearing().with_delay("u_x", 1e-4)
    plant = machine_plant(given, ["x", "y"], ["measured_x"], ["z", "x"], ["u_y"])
    assert (plant.control_names, plant.measurement_names) == (("u_x", "u_y"), ("measured_x",))
    assert (plant.performance_names, plant.disturbance_names) == (("z", "x"), ("disturbance_y",))
    assert dict(plant.delays) == {"u_x": 1e-4}
    assert machine_plant(given, (), (), (), ()).nu == 6
    response = control.frd([1.0, 2.0], [1.0, 2.0])
    measured = rp.GeneralizedPlant(response, measurements=1, controls=1)
    with pytest.raises(rp.InvalidInputError, match="model with states"):
        machine_plant(measured, (), (), (), ())


def test_the_forms_of_a_weight_and_slips():
    table = {"low": 100.0, "crossover_hz": 2.0, "high": 0.5, "order": 2}
    given: Any = asked_weight(("performance",), table)
    own = rp.weight(100.0, 2.0, 0.5, 2)
    for s in (0.0, 3j, 100j):
        np.testing.assert_allclose(given(s), own(s))
        scaled: Any = asked_weight(("performance",), {**table, "gain": 2e-7})
        np.testing.assert_allclose(scaled(s), 2e-7 * own(s))
    assert asked_weight(("effort",), 3) == 3.0
    lead: Any = asked_weight(("effort",), {"numerator": [2, 0], "denominator": [1, 5]})
    assert abs(lead(1e9j)) == pytest.approx(2)
    system = control.tf([1.0], [1.0, 1.0])
    again: Any = asked_weight(("effort",), system)
    assert again(0) == pytest.approx(1)
    for given, says in (
        ({"low": 10, "crossover": 1, "high": 0.1}, r"weights\.effort\.crossover.*crossover_hz"),
        ({"low": 10, "high": 0.1}, "no crossover_hz"),
        ({"low": 10, "crossover_hz": 1, "high": 2}, r"weights\.effort\.low.*and one below 1"),
        ({"low": 0.1, "crossover_hz": 1, "high": float("inf")}, "infinite gain at high"),
        ({"low": 10, "crossover_hz": 1, "high": 0.1, "order": 1.5}, "order"),
        ({"numerator": [1, 0, 0], "denominator": [1, 1]}, "improper"),
        ({"numerator": [1, 0], "denominator": [0, 0]}, "denominator of zeros"),
        ({"numerator": [1, 0]}, "no denominator"),
        ({"numerator": 1, "denominator": [1]}, "list of numbers"),
        ("high", "a number or a table"),
        (True, "a number or a table"),
        (-1, "above 0"),
    ):
        with pytest.raises(rp.InvalidInputError, match=says):
            asked_weight(("weights", "effort"), given)


def test_an_output_feedback_with_sampling():
    found = rp.design_machine(SPINDLE + DESIGN, sample_rate_hz=20e3, computation_delay=2e-5)
    task = found.task
    own = rp.output_feedback(task.plant, control_weight=1e-6, measurement_noise=1e-3)
    assert found.design.certificate.achieved == own.certificate.achieved
    (channel,) = found.channels
    assert (channel.disturbance, channel.output, channel.unit) == ("F_cut", "spindle", "m/N")
    assert channel.without == pytest.approx(float(rp.hinf_norm(task.plant.open_loop)))
    assert channel.controlled == pytest.approx(float(rp.hinf_norm(found.loop)))
    assert found.sampled is not None
    assert found.sampled.period == 5e-5
    assert found.to_dict()["sampled"]["delay"] == 2e-5
    assert found.analysis.requirements.sample_rate_hz == 20e3
    assert found.tables()[0].caption == "Largest gains"
    assert "H-infinity" in found.verdict()
    assert found.plot().get_xlabel() == "frequency"
    assert "Design for a machine: optimal" in repr(found)


def test_mixed_sensitivity_is_judged_on_the_machine():
    task = rp.read_design_task(
        SPINDLE + DESIGN + WEIGHTS, control_weight=None, measurement_noise=None
    )
    found = rp.design_machine(task)
    S = found.analysis.output.S
    W = rp.weight(20.0, 10.0, 0.3)
    bound = found.design.certificate.bound
    for hertz in np.geomspace(0.01, 1e4, 50):
        s = 2j * np.pi * hertz
        assert abs(W(s) * S(s)) <= bound * (1 + 1e-6)
    assert found.machine.performance_names == ("spindle",)


def test_what_cannot_be_sampled_or_controlled():
    unstable = rp.GeneralizedPlant.from_matrices([[50.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    found = rp.design_machine(
        unstable, control_weight=0.1, measurement_noise=0.1, sample_rate_hz=5.0
    )
    assert found.sampled is None
    assert found.to_dict()["sampled"] is None
    assert "longest period" in found.sampling
    assert found.channels[0].without == np.inf
    text = SPINDLE.replace("stiffness = 9.0e5", "stiffness = 0.0")
    text = text.replace("damping = 40.0", "damping = 0.0")
    with pytest.raises(rp.InfeasibleError, match="spindle"):
        rp.design_machine(text, controls=["F"], measurements=["x"])


def test_state_feedback_and_prescribed_order():
    whole = rp.design_machine(MODEL, controls=["F"], full_state=True, control_weight=1e-6)
    assert whole.design.gain is not None
    assert whole.design.gain.shape == (1, 4)
    named = rp.design_machine(
        MODEL, controls=["F"], measurements=["slide", "spindle", "dslide", "dspindle"],
        control_weight=1e-6, method="riccati",
    )  # fmt: skip
    assert named.design.certificate.achieved == pytest.approx(
        whole.design.certificate.achieved, rel=1e-3
    )
    short = rp.design_machine(
        MODEL, controls=["F"], measurements=["x"], order=1, control_weight=1e-6, norm="h2",
        measurement_noise=1e-6,
    )  # fmt: skip
    assert short.design.controller.nstates == 1
    assert short.design.norm == "h2"
