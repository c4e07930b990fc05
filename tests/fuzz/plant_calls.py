"""One call for every public function that takes a plant or a system, drawn at random."""

import inspect
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

import robustpolish as rp

from .drawn_plants import plain_system

# What says of a parameter that it takes a plant or a system; some are annotated as Any.
TYPES = ("GeneralizedPlant", "StateSpace", "UncertainSystem", "DelayedSystem", "'Design", "'Loop")
PARAMETERS = ("plants", "forward", "upper", "first", "M")
# Seconds that a search may take here; the promise is this and one second.
TIME_LIMIT = 1.0
NAMESPACES = ("uncertain", "linear", "implementation", "simulation", "polishing", "synthesis")
"""Where functions of plants stand besides the top."""

ELSEWHERE = {
    "check_robustness": "takes a learned machine",
    "compare_controllers": "takes designs and a record",
    "monte_carlo": "takes a design",
    "compare_coupled": "takes designs and a brush record",
    "linearize_with_brush": "takes a machine with a brush",
    "simulate_coupled": "takes designs and a brush record",
    "trade_off": "notes what state_feedback raises",
    "dynamics": "makes a system of a number",
    "complex": "makes a system of a number",
    "real": "makes a system of a number",
    "system": "makes a system of matrices of numbers",
    "emulated": "certify_sampled discretises by it",
    "h2_norm_lmi": "the norms by inequalities take minutes on large plants",
    "hinf_norm_lmi": "the norms by inequalities take minutes on large plants",
    "lyapunov_lmi": "the norms by inequalities take minutes on large plants",
    "is_positive_definite": "takes a matrix",
    "linear_response": "takes signals, which simulate checks",
    "zeros_on_axis": "every synthesis asks it",
}
"""Public functions that take a plant or system and are not called, with the reason."""


def taking_plants():
    """Return the names of all public functions that take or make a plant or a system."""
    places = (rp, *(getattr(rp, name) for name in NAMESPACES))
    return {name for place in places for name in dir(place) if _takes_plant(getattr(place, name))}


def public(name):
    """Return a public function by its own name, wherever it stands."""
    places = (rp, *(getattr(rp, namespace) for namespace in NAMESPACES))
    short = name.removeprefix("uncertain_")
    return next(getattr(place, n) for place in places for n in (name, short) if n in dir(place))


def _takes_plant(found):
    if not inspect.isfunction(found):
        return False
    parameters = inspect.signature(found).parameters.values()
    returned = str(inspect.signature(found).return_annotation)
    return "UncertainSystem" in returned or any(
        p.name in PARAMETERS or any(kind in repr(p.annotation) for kind in TYPES)
        for p in parameters
        if p.name[0] != "_"
    )


@dataclass
class Given:
    """A drawn plant, as the calls need it, and the controller that was certified with it."""

    plant: Any
    system: Any
    random: Any
    controller: Any = None

    def gain(self):
        """A static controller; half of them keep a stable plant stable."""
        K = self.random.standard_normal((self.plant.nu, self.plant.ny))
        K = K * 10.0 ** self.random.uniform(-3, 3) * (self.random.random() < 0.5)
        self.controller = self.plant.static_controller(K)
        return K

    def either(self, *values):
        """One of these."""
        return values[int(self.random.integers(len(values)))]

    def square(self, factor=1.0):
        """A square plain system from u to y, made by leaving out what is too much."""
        n = min(self.plant.nu, self.plant.ny)
        P = self.plant
        return plain_system(P.A, P.B2[:, :n], factor * P.C2[:n], factor * P.D22[:n, :n])

    def uncertain(self):
        """The plant with an uncertain gain of its inputs."""
        k = rp.uncertain.real("k", 1.0, percent=float(self.random.integers(1, 60)))
        return rp.uncertain.series(k * np.eye(self.system.ninputs), self.system)

    def uncertain_loop(self):
        """A feedback around an uncertain gain, with a dynamic error."""
        G = self.square()
        error = rp.uncertain.dynamics("error", G.ninputs, bound=0.1)
        k = rp.uncertain.real("k", 1.0, percent=30.0)
        L = rp.uncertain.series(k * np.eye(G.ninputs), G) * (np.eye(G.ninputs) + error)
        return rp.feedback(L, -1e-2 * np.eye(G.ninputs))


def _priced(g, **more):
    """Prices and noise that make the problem regular, every other time."""
    if g.random.random() < 0.5:
        more |= {"control_weight": 0.1, "measurement_noise": 0.1}
    return more


def _norm(g):
    return g.either("hinf", "h2")


def _simulate(g):
    time = np.arange(20) * 1e-3
    names = g.plant.disturbance_names
    signals = {name: ("time", g.random.standard_normal(20)) for name in names}
    for signal in signals:
        assert signal in names
    data = xr.Dataset(signals, {"time": ("time", time, {"units": "s"})})
    for name in names:
        data[name].attrs["units"] = "1"
    return rp.simulate(g.plant, data)


def _delayed(g):
    n = min(g.system.ninputs, g.system.noutputs)
    line = rp.simulation.DelayLine("x", float(10.0 ** g.random.uniform(-3, 1)))
    lines = (line,) if n else ()
    return rp.linear.delay_stability(rp.simulation.DelayedSystem(g.system, lines))


def _passive(g):
    name = g.plant.states[0] if g.plant.nx else "x"
    return rp.passive_feedback(g.plant, dampers=[(name, "ground")], time_limit=TIME_LIMIT)


def _design(g):
    return rp.given_controller(g.plant, g.gain() * 0)


CHEAP = {
    "append": lambda g: rp.uncertain.append(g.system, g.uncertain()),
    "certify": lambda g: rp.certify(g.plant, g.gain(), _norm(g)),
    "channel": lambda g: rp.channel(
        g.plant, g.plant.disturbance_names[:1], g.plant.performance_names[:1]
    ),
    "controllability": lambda g: rp.linear.controllability(g.system),
    "delay_stability": _delayed,
    "feedback": lambda g: rp.feedback(g.square(), 0.5),
    "given_controller": lambda g: rp.given_controller(g.plant, g.gain(), _norm(g)),
    "h2_norm": lambda g: rp.h2_norm(g.system),
    "hinf_norm": lambda g: rp.hinf_norm(g.system, exact=g.random.random() < 0.8),
    "is_detectable": lambda g: rp.linear.is_detectable(g.system),
    "is_stabilizable": lambda g: rp.linear.is_stabilizable(g.system),
    "lft": lambda g: rp.uncertain.lft(g.system, g.gain()),
    "mixed_sensitivity": lambda g: rp.mixed_sensitivity(
        g.square(), performance=rp.weight(1e3, 0.5, 0.5), effort=0.05
    ),
    "modes": lambda g: rp.modes(g.system),
    "ncf_margin": lambda g: rp.uncertain.ncf_margin(
        g.square(), np.zeros((g.square().ninputs,) * 2)
    ),
    "nu_gap": lambda g: rp.uncertain.nu_gap(g.square(), g.square(1.1)),
    "observability": lambda g: rp.linear.observability(g.system),
    "observer_controller": lambda g: rp.synthesis.observer_controller(
        g.plant, np.zeros((g.plant.nu, g.plant.nx)), np.zeros((g.plant.nx, g.plant.ny))
    ),
    "parallel": lambda g: rp.uncertain.parallel(g.system, g.uncertain()),
    "plant_at_samples": lambda g: rp.implementation.plant_at_samples(
        g.plant, float(10.0 ** g.random.uniform(-4, 1)), delay=g.either(0.0, 1e-4)
    ),
    "prescale": lambda g: rp.linear.prescale(g.system),
    "read_design_task": lambda g: rp.read_design_task(g.plant, control_weight=0.1),
    "scale_system": lambda g: rp.linear.scale_system(g.system),
    "series": lambda g: rp.uncertain.series(g.uncertain(), np.eye(g.system.noutputs)),
    "simulate": _simulate,
    "singular_values": lambda g: rp.linear.singular_values(g.system),
    "stability": lambda g: rp.linear.stability(g.system),
    "uncertain_system": lambda g: rp.uncertain.system(g.plant.A, g.plant.B2, g.plant.C2),
}
"""Calls that take a tenth of a second at most on ordinary plants."""

DEAR = {
    "certify_sampled": lambda g: rp.implementation.certify_sampled(
        g.plant, g.gain() * 0.1, period=0.01
    ),
    "compare_methods": lambda g: rp.compare_methods(
        g.plant, ("riccati",), norm=_norm(g), time_limit=TIME_LIMIT
    ),
    "cover": lambda g: rp.uncertain.cover([g.square(), g.square(1.2), g.square(0.9)], order=1),
    "design_machine": lambda g: rp.design_machine(
        g.plant, control_weight=0.1, measurement_noise=0.1
    ),
    "largest_period": lambda g: rp.synthesis.largest_period(_design(g)),
    "loop_analysis": lambda g: rp.loop_analysis(g.plant, g.gain()),
    "loop_shaping": lambda g: rp.loop_shaping(g.square()),
    "mixed_output_feedback": lambda g: rp.mixed_output_feedback(
        g.plant, hinf_bound=None, time_limit=TIME_LIMIT
    ),
    "mixed_state_feedback": lambda g: rp.mixed_state_feedback(g.plant, time_limit=TIME_LIMIT),
    "observer_feedback": lambda g: rp.observer_feedback(
        g.plant, _norm(g), **_priced(g), time_limit=TIME_LIMIT
    ),
    "output_feedback": lambda g: rp.output_feedback(
        g.plant,
        _norm(g),
        g.either("auto", "riccati", "riccati", "lmi", "slycot"),
        **_priced(g),
        time_limit=TIME_LIMIT,
    ),
    "passive_feedback": _passive,
    "robust_output_feedback": lambda g: rp.robust_output_feedback(
        g.uncertain(), g.plant.ny, g.plant.nu, time_limit=TIME_LIMIT
    ),
    "robust_performance": lambda g: rp.robust_performance(g.uncertain_loop()),
    "robust_sector": lambda g: rp.robust_sector(g.uncertain_loop(), {"error": (0.0, 0.5)}),
    "robust_stability": lambda g: rp.robust_stability(g.uncertain_loop()),
    "robust_state_feedback": lambda g: rp.robust_state_feedback(
        g.uncertain(), controls=g.plant.nu, control_weight=0.1, time_limit=TIME_LIMIT
    ),
    "scheduled_feedback": lambda g: rp.scheduled_feedback(
        g.uncertain(), controls=g.plant.nu, control_weight=0.1, time_limit=TIME_LIMIT
    ),
    "state_feedback": lambda g: rp.state_feedback(
        g.plant,
        _norm(g),
        g.either("lmi", "riccati", "riccati"),
        control_weight=g.either(None, 0.1),
        time_limit=TIME_LIMIT,
    ),
    "static_output_feedback": lambda g: rp.static_output_feedback(
        g.plant, _norm(g), **_priced(g), time_limit=TIME_LIMIT
    ),
    "structured_output_feedback": lambda g: rp.structured_output_feedback(
        g.plant, [rp.tunable.static_gain()], _norm(g), **_priced(g), time_limit=TIME_LIMIT
    ),
    "structured_singular_value": lambda g: rp.structured_singular_value(
        g.square(), g.either("full", [("real", 1)] * g.square().ninputs)
    ),
    "worst_case_gain": lambda g: rp.worst_case_gain(g.uncertain_loop()),
}
"""Calls that take longer; a plant meets one of them now and then."""

LIMITED = {name for name in DEAR if "time_limit" in inspect.signature(public(name)).parameters}
"""Those with a time limit."""
