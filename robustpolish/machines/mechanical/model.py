"""Masses joined by springs and dampers, with forces in and motions out."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import control
import xarray as xr
from numpy.typing import ArrayLike

from robustpolish.base.results import Card, Displayed
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import GROUND, EffectKind
from robustpolish.machines.mechanical.data import (
    MechanicalData,
    refuse_idle,
    values,
    with_parameter_values,
)
from robustpolish.machines.mechanical.linear import (
    frequency_response,
    linearize,
    mechanical_card,
    state_space,
    uncertain_model,
)
from robustpolish.machines.mechanical.parts import DISPLACEMENT, Dof, Input
from robustpolish.machines.mechanical.toml import read_model, write_model
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.system import UncertainSystem


@dataclass(frozen=True, repr=False)
class MechanicalModel(MechanicalData, Displayed):
    r"""Masses joined by springs and dampers, and the physical effects that were added.

    The equations of motion are ``M q'' + C q' + K q = forces - effects``; a spring,
    a damper or an effect between a pair ``(a, b)`` pulls coordinate a back with the
    force it makes of ``q_a - q_b``, or of ``q_a - r q_b`` where the two have a ratio r.

    Parameters
    ----------
    dofs : sequence of Dof
        Degrees of freedom, translational or rotational.
    springs, dampers : sequence of Spring, Damper, optional
        Connections between two coordinates, or of one to ``"ground"``.
    inputs, outputs : sequence of Input, Output, optional
        Measured signals that drive the model, and that it predicts. Without an input
        the model decays freely.
    effects : sequence of Effect, optional
        Physical effects of the catalogue, each at its place.
    spin_frequency : float, optional
        Known rotation speed in Hz.
    name : str, optional
        What the model is of.
    coupled_inertias : sequence of CoupledInertia, optional
        Inertias between two coordinates, as a double pendulum has.
    design : mapping, optional
        What is asked of a controller, as the section [design] of a file has it; it is kept, and
        read by :func:`robustpolish.read_design_task`.
    ratios : sequence of Ratio, optional
        Pulleys, screws, gears and levers between two coordinates.
    equations : sequence of Equations, optional
        Equations of motion of your own, at most one set; its coordinates and inputs need not be
        declared again.
    feedback : sequence of simulation.Feedback, optional
        Sampled controllers in whose loop the machine was measured; simulations, comparisons and
        fits run the loop. What is linearised is the machine without it.

    Raises
    ------
    InvalidInputError
        If a number is no finite number, a mass negative, a name used twice, a place
        unknown, or if translation and rotation are mixed up. The message names the key.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     dofs=[rp.Dof("x", 2.0)],
    ...     springs=[rp.Spring(("x", "ground"), 800.0)],
    ...     dampers=[rp.Damper(("x", "ground"), 4.0)],
    ...     inputs=[rp.Input("F", ("x", "ground"))],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> model.state_space().A
    array([[   0.,    1.],
           [-400.,   -2.]])

    Everything about a model is found by name, and every change makes a new model:

    >>> model.dof("x").mass, model.unit_of(model.inputs[0])
    (2.0, 'N')
    >>> model.parameters
    {'dof.x.mass': 2.0, 'spring[0].stiffness': 800.0, 'damper[0].damping': 4.0, 'input.F.gain': 1.0}
    >>> stiffer = model.with_parameters({"spring[0].stiffness": 900.0})
    >>> stiffer == rp.MechanicalModel.from_toml(stiffer.to_toml())
    True
    >>> stiffer.with_effect("cubic_stiffness", "x").without_effects() == stiffer
    True
    """

    def state_space(self) -> control.StateSpace:
        """Return the linear part, without effects, from the inputs to the outputs.

        States are the free displacements, then their velocities (``x``, ``x_dot``), then those of
        equations of motion, which are linear about their start. An
        imposed motion has an input for its displacement, ``name``, one for its velocity,
        ``name_dot``, and one for its acceleration, ``name_ddot``, if an output needs it.

        Returns
        -------
        control.StateSpace
        """
        return state_space(self)

    def linearize(
        self,
        controls: Sequence[str] | None = None,
        *,
        actuation: Literal["force", "displacement"] = "force",
        measured: Literal["outputs", "state", "displacement"] = "outputs",
        operating_point: Mapping[str, float] | None = None,
    ) -> GeneralizedPlant:
        """Return the plant for synthesis, effects linearised about a state of rest.

        The disturbances w are the model's inputs, the controls u act on coordinates, the
        performance outputs z are all free displacements. States are interleaved as in
        :func:`robustpolish.air_bearing`: ``x``, ``dx``, ...; those of the effects follow.

        Parameters
        ----------
        controls : sequence of str, optional
            Coordinates that a control acts on (named ``u_x``), or inputs, which are then controls
            instead of disturbances. All free coordinates by default.
        actuation : {"force", "displacement"}, optional
            Whether a control is a force, or is added to the velocity that moves the displacement,
            as in (10.40) of the thesis.
        measured : {"outputs", "state", "displacement"}, optional
            y: the model's outputs, all states, or all free displacements.
        operating_point : mapping of str to float, optional
            Displacement in m or rad of coordinates at rest; those that are not named are 0. By
            default the equilibrium without inputs.

        Returns
        -------
        GeneralizedPlant

        Raises
        ------
        InvalidInputError
            If a name is unknown, or there is no free coordinate.

        Warns
        -----
        RobustPolishWarning
            If an effect jumps at the operating point, as dry friction does at rest: it has no
            linear part there and is left out.

        Examples
        --------
        >>> import robustpolish as rp
        >>> model = rp.MechanicalModel(
        ...     [rp.Dof("x", 2.0)], [rp.Spring(("x", "ground"), 8.0)], outputs=[rp.Output("x", "x")]
        ... ).with_effect("quadratic_stiffness", ("x", "ground"), {"stiffness": 3.0})
        >>> model.linearize(operating_point={"x": 0.5}).A.round(6)
        array([[ 0. ,  1. ],
               [-5.5,  0. ]])
        """
        return linearize(self, controls, actuation, measured, operating_point)

    def uncertain(
        self, ranges: Mapping[str, float | tuple[float, float] | UncertainSystem]
    ) -> UncertainSystem:
        """Return the linear part with some of its numbers uncertain, from inputs to outputs.

        Parameters
        ----------
        ranges : mapping of str to float, (float, float) or UncertainSystem
            By the keys of `parameters`: how far a number may be off as a share of it (0.1 is 10 %
            up or down), its smallest and largest value, or an uncertain number, whose nominal
            value it then takes: of :func:`robustpolish.uncertain.ellipsoid`, or any formula of
            such. Masses, inertias, springs, dampers and gains of forces.

        Returns
        -------
        UncertainSystem
            With the inputs, outputs and states of :meth:`state_space`, and one element per key, by
            that name, or those of the numbers given; effects are left out, as there.

        Raises
        ------
        InvalidInputError
            If a key is unknown or of another kind, or a range does not hold the number.

        Examples
        --------
        >>> import robustpolish as rp
        >>> model = rp.MechanicalModel(
        ...     [rp.Dof("x", 2.0)], [rp.Spring(("x", "ground"), 800.0)],
        ...     inputs=[rp.Input("F", ("x", "ground"))], outputs=[rp.Output("x", "x")],
        ... )
        >>> machine = model.uncertain({"spring[0].stiffness": 0.1, "dof.x.mass": (1.5, 2.5)})
        >>> machine.at({"spring[0].stiffness": 880.0, "dof.x.mass": 2.5}).A[1, 0].round(6)
        np.float64(-352.0)

        Two numbers that are known together:

        >>> P = [[100.0, 0.24], [0.24, 0.0006]]
        >>> centre = {"spring[0].stiffness": 800, "dof.x.mass": 2}
        >>> fit = rp.uncertain.ellipsoid(centre, covariance=P)
        >>> machine = model.uncertain(fit)
        >>> machine.at({"spring[0].stiffness": 820.0, "dof.x.mass": 2.05}).A[1, 0].round(6)
        np.float64(-400.0)
        """
        return uncertain_model(self, ranges)

    def frequency_response(
        self,
        frequency: ArrayLike,
        *,
        operating_point: Mapping[str, float] | None = None,
        sampling_time: float | None = None,
    ) -> xr.DataArray:
        """Return the response over frequency, effects linearised about a state of rest.

        Delays of inputs are exact, not rational approximations.

        Parameters
        ----------
        frequency : array_like, shape (lines,)
            In Hz.
        operating_point : mapping of str to float, optional
            As in :meth:`linearize`.
        sampling_time : float, optional
            In s, of inputs that are held between samples (the effect ``input_hold``).

        Returns
        -------
        xarray.DataArray
            Complex, over ``frequency``, ``output`` and ``input``, with ``units``; NaN where it is
            infinite. ``attrs["notes"]`` tells which effects have no linear part.

        Raises
        ------
        InvalidInputError
            If the model has no input or no output, or a name is unknown.

        Examples
        --------
        >>> import robustpolish as rp
        >>> model = rp.MechanicalModel(
        ...     [rp.Dof("x", 1.0)], [rp.Spring(("x", "ground"), 4.0)],
        ...     inputs=[rp.Input("F", ("x", "ground"))],
        ...     outputs=[rp.Output("x", ("x", "ground"))],
        ... )
        >>> static = model.frequency_response([0.0]).sel(output="x", input="F")
        >>> static.item(), static["units"].item()
        ((0.25+0j), 'm/N')
        """
        return frequency_response(self, frequency, operating_point, sampling_time)

    # Changes -------------------------------------------------------------------------

    def with_effect(
        self,
        kind: str | EffectKind,
        at: str | Sequence[str],
        parameters: Mapping[str, float] | None = None,
    ) -> MechanicalModel:
        """Return the model with one more effect.

        Parameters
        ----------
        kind : str or EffectKind
            Name in the catalogue of effects, or a kind of your own, see :func:`effect`.
        at : str or sequence of str
            Where it acts, such as ``("x", "ground")``.
        parameters : mapping of str to float, optional
            Values in SI units by name.

        Returns
        -------
        MechanicalModel

        Raises
        ------
        InvalidInputError
            If kind, place or a parameter is unknown, or the effect does nothing in this model: a
            backlash without a spring, an unbalance without a spin frequency.

        Examples
        --------
        >>> import robustpolish as rp
        >>> outputs = [rp.Output("x", ("x", "ground"))]
        >>> model = rp.MechanicalModel([rp.Dof("x", 2.0)], outputs=outputs)
        >>> model.with_effect("coulomb_friction", ("x", "ground"), {"force": 3.1}).effects[0].kind
        'coulomb_friction'
        """
        place = (at,) if isinstance(at, str) else tuple(at)
        if isinstance(kind, EffectKind):
            effect = Effect.of(kind, place, parameters)
        else:
            effect = Effect(kind, place, parameters or {})
        model = self
        for name, unit in effect.definition.channels:
            if name not in model.dof_names:
                model = model.with_channel(name, unit)
        refuse_idle(model, effect)
        return replace(model, effects=(*self.effects, effect))

    def with_channel(self, name: str, unit: str) -> MechanicalModel:
        """Return the model with a measured signal that effects may read, such as a voltage.

        It is a coordinate without mass, and an input that imposes it. `with_effect` adds what an
        effect reads by itself; for a diagnosis it has to be there.

        Parameters
        ----------
        name : str
            The data column.
        unit : str
            Its unit.

        Returns
        -------
        MechanicalModel

        Raises
        ------
        InvalidInputError
            If a coordinate, an input or an output has this name.

        Examples
        --------
        >>> import robustpolish as rp
        >>> outputs = [rp.Output("x", ("x", "ground"))]
        >>> model = rp.MechanicalModel([rp.Dof("x", 2.0)], outputs=outputs)
        >>> model.with_channel("u", "V").channels
        ('u',)
        """
        source = Input(name, (name, GROUND), DISPLACEMENT, unit=unit)
        return replace(self, dofs=(*self.dofs, Dof(name, 0.0)), inputs=(*self.inputs, source))

    def without_effects(self) -> MechanicalModel:
        """Return the linear model; its loops without limits and steps.

        Returns
        -------
        MechanicalModel
        """
        return replace(self, effects=(), feedback=tuple(loop.linear for loop in self.feedback))

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by its key, such as ``"spring[0].stiffness"``.

        Keys are ``dof.NAME.mass`` (or ``.inertia``), ``ratio[i].value``,
        ``parameter.NAME`` (of equations), ``coupled_inertia[i].value``, ``spring[i].stiffness``,
        ``damper[i].damping``, ``input.NAME.gain`` and ``effect[i].PARAMETER``.
        """
        return values(self)

    def with_parameters(self, values: Mapping[str, float]) -> MechanicalModel:
        """Return the model with some numbers changed, by the keys of `parameters`.

        Parameters
        ----------
        values : mapping of str to float
            New values in SI units, by the keys of `parameters`.

        Returns
        -------
        MechanicalModel

        Raises
        ------
        InvalidInputError
            If there is no such key, or a value is not allowed.
        """
        return with_parameter_values(self, values)

    # Files and machines --------------------------------------------------------------

    @classmethod
    def from_air_bearing(
        cls, parameters: Any = None, dissipation: float = 0.001
    ) -> MechanicalModel:
        """Return :func:`robustpolish.polishing.air_bearing_model`, whose old name this is.

        Parameters
        ----------
        parameters : AirBearingParameters, optional
        dissipation : float, optional

        Returns
        -------
        MechanicalModel

        Warns
        -----
        DeprecationWarning
            The name goes with version 0.3.

        Examples
        --------
        >>> import warnings
        >>> import robustpolish as rp
        >>> with warnings.catch_warnings():
        ...     warnings.simplefilter("ignore")  # the old name warns
        ...     rp.MechanicalModel.from_air_bearing().free
        ('x_m', 'x', 'y_m', 'y', 'z_m', 'z')
        """
        import robustpolish

        text = "MechanicalModel.from_air_bearing is now robustpolish.polishing.air_bearing_model"
        warnings.warn(f"{text}; it goes with version 0.3", DeprecationWarning, stacklevel=2)
        return robustpolish.polishing.air_bearing_model(parameters, dissipation)

    @classmethod
    def from_toml(cls, source: str | Path, *, max_bytes: float | None = None) -> MechanicalModel:
        """Read a model from a TOML file, or from its text if `source` has a line break.

        Parameters
        ----------
        source : path or str
            Or the name of a ready machine: cart_and_pendulum, rotary_pendulum, double_pendulum,
            ball_and_beam, dc_motor, magnetic_levitation, two_link_arm, quarter_car,
            pneumatic_cylinder.
        max_bytes : float, optional
            Largest size of the file in bytes, 1e7 by default.

        Returns
        -------
        MechanicalModel

        Raises
        ------
        InvalidInputError
            If the file cannot be read or is no model; the message names the line or key.
        """
        data = read_model(source, max_bytes)
        return cls(**{field.name: getattr(data, field.name) for field in fields(MechanicalData)})

    def to_toml(self, path: str | Path | None = None) -> str:
        """Return the model as TOML text, and write it to `path` if one is given.

        Parameters
        ----------
        path : path, optional
            Where to write it, whole or not at all; an existing file is replaced.

        Returns
        -------
        str
        """
        return write_model(self, path)

    def _card(self) -> Card:
        return mechanical_card(self)
