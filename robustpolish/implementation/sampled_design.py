"""A controller as a computer runs it: imitated at samples, with a certificate of its loop."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import control
import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import invalid, misfit, positive
from robustpolish.base.results import Card, Displayed, quantities, shown
from robustpolish.base.saved import Fields, confirm_norm, read_saved, write_saved
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.certify_sampled import (
    certify_sampled,
    checked_delay,
    checked_plant,
    discrete_controller,
    filtered_plant,
    longest_period,
    with_signal_names_of,
)
from robustpolish.implementation.export.files import (
    CodeSpec,
    write_c,
    write_fmu,
    write_json,
    write_mat,
)
from robustpolish.implementation.realization import (
    FORMS,
    Limits,
    SinglePrecision,
    control_limits,
    emulated,
    realized,
    single_precision,
)
from robustpolish.implementation.realization import anti_windup as anti_windup_gain
from robustpolish.implementation.run import sampled_run
from robustpolish.implementation.sampled import certificate as certificates
from robustpolish.implementation.sampled import lifting
from robustpolish.linear.norms.hinf import singular_values
from robustpolish.linear.stability import stability
from robustpolish.linear.systems import named_system
from robustpolish.plants.plant import (
    GeneralizedPlant,
    check_size,
    plant_content,
    plant_from,
    system_content,
    system_from,
)
from robustpolish.plots.frequency import plot_gains


@dataclass(frozen=True, eq=False, repr=False)
class SampledDesign(Displayed):
    """A discrete controller for a continuous plant, certified with everything between the samples.

    Attributes
    ----------
    plant : GeneralizedPlant
        Continuous, as it was designed for; without the anti-aliasing filter.
    controller : control.StateSpace
        Discrete: u[k] = K y[k], positive sign.
    period, delay : float
        Seconds between samples, and from a sample until its control acts.
    certificate : SampledCertificate
        Of the loop with hold, delay and filter.
    message : str
        What sampling cost.
    norm : {"hinf", "h2"}
        The norm that is certified.
    continuous_norm : float
        The norm of the continuous loop that it imitates.
    method : str
        How the controller was imitated: "tustin", ...
    anti_aliasing : control.StateSpace or None
        The analogue filter before the samplers.
    details : mapping
        What else is known.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> rp.given_controller(plant, [[-3.0]]).discretize(0.3, delay=0.12)
    Sampled design (tustin): valid
      period [s]             0.3
      delay [s]              0.12
      controller             a static gain
      norm, continuous       0.5
      norm, sampled          0.797087, proven between 0.797086 and 0.797088
      largest pole           0.676701
      Sampled every 300 ms with a delay of 120 ms, the loop is stable; its norm rises ...
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    period: float
    delay: float
    certificate: certificates.SampledCertificate
    message: str
    norm: certificates.Norm
    continuous_norm: float
    method: str = "tustin"
    anti_aliasing: control.StateSpace | None = None
    details: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def cost(self) -> float:
        """By how much the norm has risen, relative: 0.05 is 5 percent."""
        before = self.continuous_norm
        return self.certificate.achieved / before - 1 if before > 0 else np.inf

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Write the sampled design to one JSON file, whole or not at all.

        Parameters
        ----------
        path : path
            Ends in ``.json``; its folder has to exist.
        force : bool, optional
            Replace an existing file.

        Raises
        ------
        InvalidInputError
            If the file exists and `force` is not set, or it cannot be written there.

        Examples
        --------
        >>> import os, tempfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1, delay=0.05)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     sampled.save(os.path.join(folder, "sampled.json"))
        ...     again = rp.results.SampledDesign.load(os.path.join(folder, "sampled.json"))
        >>> again.certificate.valid, again.certificate.bound == sampled.certificate.bound
        (True, True)
        """
        analogue = self.anti_aliasing
        content = {
            "norm": self.norm,
            "achieved": self.certificate.achieved,
            "continuous_norm": self.continuous_norm,
            "message": self.message,
            "method": self.method,
            "period": self.period,
            "delay": self.delay,
            "form": self.details.get("form"),
            "plant": plant_content(self.plant),
            "controller": system_content(self.controller),
            "anti_aliasing": None if analogue is None else system_content(analogue),
        }
        write_saved(path, "sampled design", content, force)

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, max_bytes: float | None = None) -> SampledDesign:
        """Read a sampled design from a file, and certify it again: the file is not believed.

        Parameters
        ----------
        path : path
            A file that :meth:`save` wrote.
        max_bytes : float, optional
            Largest size of the file in bytes, 2e8 by default.

        Returns
        -------
        SampledDesign
            Of its details only the ``form`` is kept.

        Raises
        ------
        InvalidInputError
            If it is no such file, or if its controller does not earn a certificate for the norm
            that the file claims.

        Examples
        --------
        See :meth:`save`.

        >>> import robustpolish as rp
        >>> rp.results.SampledDesign.load("missing.json")
        Traceback (most recent call last):
        ...
        robustpolish.errors.InvalidInputError: path: got missing.json (No such file or directory)...
        """
        return sampled_from(read_saved(path, "sampled design", max_bytes))

    def realization(self, form: str = "balanced") -> SampledDesign:
        """Return the same controller in other coordinates, and say what single precision costs it.

        Parameters
        ----------
        form : {"balanced", "modal", "sections"}, optional
            "balanced": states as easy to reach as to see. "modal": a block of one or two
            states per mode, as large at its input as at its output. "sections": the same blocks
            scaled to inputs of one unit.

        Returns
        -------
        SampledDesign
            Certified afresh. ``details["single_precision"]`` holds the certificate with
            coefficients rounded to single precision, the shift of the poles, and bounds of what
            rounding adds to the controls; the message sums it up.

        Raises
        ------
        InvalidInputError
            If the form is unknown.
        SolverError
            If the new coordinates lose the certificate.

        Examples
        --------
        >>> import control
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> K = control.ss([[-9.0]], [[3.0]], [[-10.0]], 0)
        >>> sampled = rp.given_controller(plant, K).discretize(0.01).realization("modal")
        >>> loss = sampled.details["single_precision"]
        >>> loss.certificate.valid, loss.pole_shift < 1e-7
        (True, True)
        """
        K = realized(self.controller, form)
        certificate = certificates.certificate_of(self._filtered, K, self.delay, self.norm)
        if not certificate.valid:
            raise SolverError(
                f"form: the loop has no certificate with a {form} controller, because "
                + "; ".join(certificate.reasons)
                + ". Choose another form."
            )
        achieved = certificate.achieved
        loss = single_precision(self._filtered, K, self.delay, self.norm, achieved)
        details = {**self.details, "form": form, "single_precision": loss}
        message = f"{self.message} Realised in {form} form. {loss.sentence}"
        return replace(
            self,
            controller=K,
            certificate=certificate,
            message=message,
            details=MappingProxyType(details),
        )

    def simulate(
        self, disturbance: xr.Dataset, limits: Limits = None, *, anti_windup: str = "auto"
    ) -> xr.Dataset:
        """Simulate the sampled loop from rest, exactly between its samples.

        Parameters
        ----------
        disturbance : xarray.Dataset
            One variable over `time` (s) per disturbance w, by name, linear between its samples;
            those that are missing are zero, other variables are ignored.
        limits : float, (float, float), mapping or list, optional
            Of the controls: a size, (low, high), either by name, or an entry per control. By
            default those of the plant (``with_actuator(..., limit=)``); `math.inf` for none.
        anti_windup : {"auto", "conditioned", "observer", "none"}, optional
            How the controller's states follow a control that was cut off at a limit: as if y had
            asked for it (Hanus), or by an observer; "auto" takes the first where it is stable.

        Returns
        -------
        xarray.Dataset
            Every z, and every control as it acts (held, late, within its limits), over `time` with
            at least ten steps per sample. ``at_limit`` among a control's attributes tells
            at which part of the samples it was cut off. A control that is called as a z gets
            a number behind its name, as in :func:`robustpolish.simulate`.

        Raises
        ------
        InvalidInputError
            If the disturbance or the limits do not fit.

        Examples
        --------
        >>> import numpy as np
        >>> import xarray as xr
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
        >>> push = xr.Dataset({"w1": ("time", np.ones(101))}, {"time": np.linspace(0, 10, 101)})
        >>> run = sampled.simulate(push, limits=2.0)
        >>> round(float(run["z1"][-1]), 3), round(float(run["u1"][-1]), 3)
        (0.5, -1.5)
        """
        found, K = self._limits(limits), self.controller
        if found is None:
            windup = np.zeros((K.nstates, K.noutputs))
        else:
            windup = anti_windup_gain(K, anti_windup).L
        return sampled_run(self._filtered, K, self.delay, disturbance, found, windup)

    def export_c(
        self,
        path: str | os.PathLike[str],
        name: str = "controller",
        precision: str = "double",
        limits: Limits = None,
        *,
        anti_windup: str = "auto",
        test_vectors: int = 0,
        force: bool = False,
    ) -> Path:
        """Write the controller as one C99 file without allocation.

        Parameters
        ----------
        path : path
            An existing folder, or a file that ends in ``.c``.
        name : str, optional
            Before every name in the file: ``name_state``, ``name_init``, ``name_step``.
        precision : {"double", "float"}, optional
            For "float" the loop is certified with rounded coefficients, and the head of the file
            states a bound on the difference of the outputs.
        limits : float, (float, float), mapping or list, optional
            Of the controls, as in :meth:`simulate`.
        anti_windup : {"auto", "conditioned", "observer", "none"}, optional
            As in :meth:`simulate`.
        test_vectors : int, optional
            So many random samples of y and u are written to ``<file>_vectors.csv``.
        force : bool, optional
            Replace existing files.

        Returns
        -------
        pathlib.Path
            Of the C file.

        Raises
        ------
        InvalidInputError
            If an argument is wrong, or the file exists.
        InfeasibleError
            If the loop is unstable with coefficients in single precision.

        Examples
        --------
        >>> import tempfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     text = sampled.export_c(folder, name="lag", limits=10.0).read_text()
        >>> "void lag_step(lag_state *s, const double y[1], double u[1]);" in text
        True
        """
        loss = self._single() if precision == "float" else None
        about = () if loss is None else (loss.sentence,)
        spec = self._spec(limits, anti_windup, about)
        return write_c(spec, path, name, precision, loss, test_vectors=test_vectors, force=force)

    def export_mat(
        self,
        path: str | os.PathLike[str],
        name: str = "controller",
        limits: Limits = None,
        *,
        anti_windup: str = "auto",
        force: bool = False,
    ) -> Path:
        """Write the controller as a MAT file.

        Parameters
        ----------
        path : path
            An existing folder, or a file that ends in ``.mat``.
        name : str, optional
            Of the file, if `path` is a folder.
        limits : float, (float, float), mapping or list, optional
            Of the controls, as in :meth:`simulate`.
        anti_windup : {"auto", "conditioned", "observer", "none"}, optional
            As in :meth:`simulate`.
        force : bool, optional
            Replace an existing file.

        Returns
        -------
        pathlib.Path
            The file holds A, B, C, D, Ts, InputName, OutputName, InputUnit, OutputUnit, delay, low,
            high, and L of the anti-windup. In MATLAB: ``load controller; K = ss(A, B, C, D, Ts)``,
            connected with positive sign.

        Raises
        ------
        InvalidInputError
            If an argument is wrong, or the file exists.

        Examples
        --------
        >>> import tempfile
        >>> from scipy.io import loadmat
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     content = loadmat(sampled.export_mat(folder))
        >>> float(content["D"][0, 0]), float(content["Ts"][0, 0])
        (-3.0, 0.1)
        """
        return write_mat(self._spec(limits, anti_windup), path, name, force=force)

    def export_json(
        self,
        path: str | os.PathLike[str],
        name: str = "controller",
        limits: Limits = None,
        *,
        anti_windup: str = "auto",
        force: bool = False,
    ) -> Path:
        """Write the controller as a JSON file.

        Parameters
        ----------
        path : path
            An existing folder, or a file that ends in ``.json``.
        name : str, optional
            Of the file, if `path` is a folder.
        limits : float, (float, float), mapping or list, optional
            Of the controls, as in :meth:`simulate`.
        anti_windup : {"auto", "conditioned", "observer", "none"}, optional
            As in :meth:`simulate`.
        force : bool, optional
            Replace an existing file.

        Returns
        -------
        pathlib.Path
            Matrices, names, units, period, delay, limits and the sign, every number exact.

        Raises
        ------
        InvalidInputError
            If an argument is wrong, or the file exists.

        Examples
        --------
        >>> import json, tempfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     content = json.loads(sampled.export_json(folder).read_text())
        >>> content["D"], content["period"], content["sign"]
        ([[-3.0]], 0.1, 'u[k] = +K y[k]')
        """
        return write_json(self._spec(limits, anti_windup), path, name, force=force)

    def export_fmu(
        self,
        path: str | os.PathLike[str],
        name: str = "controller",
        limits: Limits = None,
        *,
        anti_windup: str = "auto",
        force: bool = False,
    ) -> Path:
        """Write the controller as an FMU for co-simulation (FMI 2.0), compiled for this machine.

        Parameters
        ----------
        path : path
            An existing folder, or a file that ends in ``.fmu``.
        name : str, optional
            Of the model.
        limits : float, (float, float), mapping or list, optional
            Of the controls, as in :meth:`simulate`.
        anti_windup : {"auto", "conditioned", "observer", "none"}, optional
            As in :meth:`simulate`.
        force : bool, optional
            Replace an existing file.

        Returns
        -------
        pathlib.Path
            Inputs are the measurements, outputs the controls as they act, held and late by the
            delay. Samples are taken at the start time and every period after it, of the inputs
            that were set before the step which begins there; steps may be of any length. Its
            source is inside, for other machines.

        Raises
        ------
        InvalidInputError
            If an argument is wrong, or the file exists.
        MissingDependencyError
            If there is no C compiler.

        Examples
        --------
        >>> import tempfile, zipfile
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     zipfile.ZipFile(sampled.export_fmu(folder)).namelist()[0]
        'modelDescription.xml'
        """
        return write_fmu(self._spec(limits, anti_windup), path, name, force=force)

    @property
    def _filtered(self) -> GeneralizedPlant:
        return certificates.with_filter(self.plant, self.anti_aliasing)

    def _limits(self, limits: Limits) -> tuple[Vector, Vector] | None:
        """Return the limits that are meant: by default those that the plant knows."""
        given = self.plant.limits if limits is None else limits
        return control_limits(given, self.controller.output_labels)

    def _single(self) -> SinglePrecision:
        """Return the loop in single precision, certified."""
        loss = self.details.get("single_precision")
        if loss is None:
            before = self.certificate.achieved
            loss = single_precision(self._filtered, self.controller, self.delay, self.norm, before)
        if not loss.certificate.valid:
            raise InfeasibleError(
                "precision: with coefficients rounded to single precision, "
                + "; ".join(loss.certificate.reasons)
                + ". Take another form first, with .realization('sections'), or 'double'."
            )
        return loss

    def _spec(self, limits: Limits, anti_windup: str, about: tuple[str, ...] = ()) -> CodeSpec:
        K, plant, c = self.controller, self.plant, self.certificate
        found = self._limits(limits)
        windup = anti_windup_gain(K, anti_windup if found is not None else "none")
        kind = "induced L2" if self.norm == "hinf" else "H2"
        filtered = self.anti_aliasing
        words = [
            f"Plant: {plant.nx} states, from {', '.join(plant.disturbance_names)} to "
            f"{', '.join(plant.performance_names)}.",
            f"Sampled every {self.period:.9g} s; the control acts {self.delay:.9g} s after its "
            f"sample and is held. Imitated by {self.method}.",
            "Without an anti-aliasing filter."
            if filtered is None
            else f"Behind an analogue anti-aliasing filter of {filtered.nstates} states in all.",
            f"The {kind} norm of the sampled loop is proven to be at most {c.bound:.6g} "
            f"({self.continuous_norm:.6g} with the continuous controller).",
        ]
        if windup.form != "none":
            words.append(f"Limits with anti-windup in {windup.form} form; no norm is proven there.")
        return CodeSpec(K, self.period, self.delay, plant.units, found, windup.L, (*words, *about))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the gain from w to z without control and in the sampled loop over frequency.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            Up to half the sample rate: RMS of z for a sinusoidal w of RMS one, with all
            frequencies in z that it brings about. The norm may lie a little higher, because the
            worst w holds several frequencies.

        Examples
        --------
        >>> import robustpolish as rp
        >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
        >>> rp.given_controller(plant, [[-3.0]]).discretize(0.1).plot().get_xlabel()
        'frequency'
        """
        sampled = certificates.sinusoid_gains(self._filtered, self.controller, self.delay)
        open_loop = self.plant.open_loop
        without = singular_values(open_loop, sampled["frequency"].values).isel(singular_value=0)
        name = "without control" + ("" if stability(open_loop) else " (unstable)")
        gains = {name: without, "sampled loop": sampled}
        c = self.certificate
        mark = {}
        if c.peak_frequency is not None:
            mark = {f"norm {c.achieved:.4g}": (c.peak_frequency / (2 * np.pi), c.achieved)}
        return plot_gains(gains, mark, ax, first_style=0)

    def _card(self) -> Card:
        c, order = self.certificate, self.controller.nstates
        rows = (
            ("period [s]", f"{self.period:.6g}"),
            ("delay [s]", f"{self.delay:.6g}"),
            ("controller", f"{order} states" if order else "a static gain"),
            ("norm, continuous", f"{self.continuous_norm:.6g}"),
            ("norm, sampled", f"{c.achieved:.6g}, proven between {c.lower:.6g} and {c.bound:.6g}"),
            ("largest pole", f"{c.spectral_radius:.6g}"),
        )
        verdict = "valid" if c.valid else "NOT valid"
        notes = (self.message, *c.reasons, *c.notes)
        return Card(f"Sampled design ({self.method}): {verdict}", (quantities(*rows),), notes)


_REMEDY = "Plant, controller or timing were changed after saving; discretize it anew."


def sampled_from(fields: Fields) -> SampledDesign:
    """Return the sampled design in a file that has been opened, with a new certificate.

    Raises
    ------
    InvalidInputError
        If a key is missing or wrong, if the controller does not earn a certificate, or if its
        loop has another norm than the file says.
    """
    plant = checked_plant(plant_from(fields.table("plant")))
    given = system_from(fields.table("controller"))
    check_size(fields, plant.system, given)
    period, delay = fields.number("period"), fields.number("delay")
    if not (math.isfinite(period) and period > 0):
        raise invalid(f"{fields.where}: period", period, "a time above 0 s", _REMEDY)
    delay = checked_delay(delay, period)
    controller = discrete_controller(plant, given, period)
    analogue = None
    if fields.raw("anti_aliasing") is not None:
        analogue = certificates.filter_system(system_from(fields.table("anti_aliasing")), plant.ny)
    norm: Any = fields.text("norm", ("hinf", "h2"))
    certificate = certify_sampled(plant, controller, delay=delay, norm=norm, anti_aliasing=analogue)
    confirm_norm(fields, certificate, _REMEDY)
    before = fields.number("continuous_norm")
    if np.isnan(before) or before < 0:
        raise invalid(f"{fields.where}: continuous_norm", before, "a norm", _REMEDY)
    form = None if fields.raw("form") is None else fields.text("form", FORMS)
    return SampledDesign(
        plant=plant,
        controller=controller,
        period=period,
        delay=delay,
        certificate=certificate,
        message=fields.text("message"),
        norm=certificate.norm,
        continuous_norm=before,
        method=fields.text("method"),
        anti_aliasing=analogue,
        details=MappingProxyType({} if form is None else {"form": form}),
    )


# A continuous plant as the computer sees it: from controls to measurements, sample to sample.


def plant_at_samples(
    plant: GeneralizedPlant,
    period: float,
    delay: float = 0.0,
    *,
    anti_aliasing: certificates.AntiAliasing = None,
) -> control.StateSpace:
    """Return the plant from its controls to its measurements at samples, exactly.

    With it the loop of a discrete controller is one in discrete time, whose margins
    :func:`robustpolish.loop_analysis` finds: hold and delay are in them as they are.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    period, delay : float
        Seconds between samples, and from a sample until its control acts.
    anti_aliasing : float, (int, float) or control system, optional
        Analogue filter before the samplers, as in :meth:`Design.discretize`.

    Returns
    -------
    control.StateSpace
        With sampling time `period`; controls that the delays still hold back are among its
        states. The plant's own delays count too, from its controls and to its measurements.

    Raises
    ------
    InvalidInputError
        If the plant is discrete, the delays together are longer than 200 periods, or delays of
        the plant differ between its controls or measurements or stand inside it.

    Notes
    -----
    Åström and Wittenmark, Computer-Controlled Systems, section 2.3. A measurement is taken just
    before the control changes, so that a direct path is delayed by a sample at least.

    Examples
    --------
    >>> import control
    >>> import robustpolish as rp
    >>> lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    >>> plant = rp.GeneralizedPlant(lag, measurements="y", controls="u")
    >>> sampled = rp.implementation.plant_at_samples(plant, period=0.1, delay=0.05)
    >>> sampled.dt, sampled.nstates, round(float(control.dcgain(sampled)), 6)
    (0.1, 2, 1.0)
    """
    checked_plant(plant)
    period = positive("period", period, "s")
    plant, own = lifting.without_loop_delay(plant)
    delay = checked_delay(positive("delay", delay, "s", zero=True) + own, period)
    if plant.delays:
        shown = ", ".join(f"{name} {duration(each)}" for name, each in plant.delays.items())
        want = "the same delay at all controls and the same at all measurements"
        remedy = "certify_sampled takes it, with a Pade model of what differs."
        raise misfit("plant", f"delays that remain at single signals: {shown}", want, remedy)
    plant = certificates.with_filter(plant, certificates.filter_system(anti_aliasing, plant.ny))
    still = named_system(
        ([], [], [], np.zeros((plant.nu, plant.ny))),
        period,
        plant.measurement_names,
        plant.control_names,
    )
    found = lifting.period_map(plant, still, period, delay)
    through = found.transition()
    A, B = found.N0 + found.M @ through @ found.L0, found.Nu + found.M @ through @ found.Lu
    if not np.isfinite(A).all() or not np.isfinite(B).all():
        raise lifting.beyond_a_period(period)
    # Averages of noise are states of the loop, but none of the plant.
    kept = np.r_[: plant.nx, plant.nx + len(found.noisy) : len(A)]
    ages = range(1, 1 + (len(kept) - plant.nx) // plant.nu)
    held = [f"{u} held {age}" for age in ages for u in plant.control_names]
    matrices = A[np.ix_(kept, kept)], B[kept], found.Y[:, kept], np.zeros((plant.ny, plant.nu))
    labels = plant.control_names, plant.measurement_names, [*plant.states, *held]
    return named_system(matrices, period, *labels)


_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"), (1e-12, "ps"))


def discretized(
    plant: GeneralizedPlant,
    controller: control.StateSpace,
    period: float,
    delay: float,
    norm: certificates.Norm,
    continuous_norm: float,
    *,
    method: str = "tustin",
    prewarp_hz: float | None = None,
    anti_aliasing: certificates.AntiAliasing = None,
    details: Mapping[str, Any] | None = None,
) -> SampledDesign:
    """Imitate a controller at samples and certify the sampled loop; see `Design.discretize`.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous.
    controller : control.StateSpace
        Continuous, or a static gain.
    period, delay : float
        In s.
    norm : {"hinf", "h2"}
    continuous_norm : float
        The norm of the continuous loop.
    method : str, optional
    prewarp_hz : float, optional
        See `emulated`.
    anti_aliasing : float, (int, float) or control system, optional
        See `certify_sampled`.
    details : mapping, optional
        What else is to be known of the result.

    Returns
    -------
    SampledDesign

    Raises
    ------
    InvalidInputError
        If an argument is wrong.
    InfeasibleError
        If the sampled loop is unstable; it tells the longest period that keeps it stable.
    SolverError
        If the loop is stable as far as doubles can tell, but no bound could be proven.
    """
    checked_plant(plant)
    period = positive("period", period, "s")
    delay = checked_delay(delay, period)
    filtering = certificates.filter_system(anti_aliasing, plant.ny)
    filtered = filtered_plant(plant, filtering, norm, "design for")
    K = with_signal_names_of(plant, emulated(controller, period, method, prewarp_hz))
    certificate = certificates.certificate_of(filtered, K, delay, norm)
    late = f" with a delay of {duration(delay)}" if delay else ""
    how = f"ampled every {duration(period)}{late}, the loop"
    if not certificate.stable:
        raise InfeasibleError(
            f"period: s{how} is unstable (a pole of size {certificate.spectral_radius:.6g}). "
            + _remedy(filtered, controller, period, delay, method, prewarp_hz),
            [p for p in certificate.poles if abs(p) >= 1],
        )
    if not certificate.valid:
        raise SolverError(
            f"period: s{how} has no certificate, because {'; '.join(certificate.reasons)}"
            ". Reduce the controller first, or change the period."
        )
    return SampledDesign(
        plant=plant,
        controller=K,
        period=period,
        delay=delay,
        certificate=certificate,
        message=f"S{how} is stable; {_cost(continuous_norm, certificate.achieved)}"
        f"{_beyond_nyquist(filtered, K, certificate, continuous_norm)}.",
        norm=norm,
        continuous_norm=continuous_norm,
        method=method,
        anti_aliasing=filtering,
        details=details or MappingProxyType({}),
    )


def duration(seconds: float) -> str:
    """Return a time with a handy unit.

    Examples
    --------
    >>> duration(2.5e-4), duration(0.0)
    ('250 us', '0 s')
    """
    sizes = (unit for unit in _UNITS if seconds >= unit[0] * (1 - 1e-9))
    size, unit = next(sizes, _UNITS[0])
    return f"{shown(float(seconds) / size, 4)} {unit}"


def _cost(before: float, after: float) -> str:
    if before <= 0 or not math.isfinite(before):
        return f"its norm is {after:.4g}"
    change = 100 * (after / before - 1)
    if abs(change) < 0.05:
        return f"its norm stays at {after:.4g}"
    verb = "rises" if change > 0 else "falls"
    percent = f"{change:+.1f}" if abs(change) < 10 else f"{change:+.0f}"
    return f"its norm {verb} from {before:.4g} to {after:.4g} ({percent} %)"


def _beyond_nyquist(
    plant: GeneralizedPlant,
    K: control.StateSpace,
    found: certificates.SampledCertificate,
    before: float,
) -> str:
    """Say whether a norm that more than doubles does so beyond half the sampling rate, and where.

    The norm counts all between the samples: also the steps of the controls, where a weight on them
    is still large.
    """
    if found.norm == "h2" or not 0 < 2 * before < found.achieved:
        return ""
    half = math.pi / found.period
    lag = control.StateSpace([[-half]], [[half]], [[1.0]], [[0.0]])
    lower, name = min(
        (certificates.certificate_of(part, K, found.delay, found.norm).achieved, name)
        for name in plant.performance_names
        for part in [plant.with_filter(name, lag)]
    )
    if lower > math.sqrt(before * found.achieved):
        return ""
    return (
        f"; with {name} through a lag at half the sampling rate ({half / (2 * math.pi):.4g} Hz) it "
        f"is {lower:.4g}: the rise lies beyond, where its weight is still large"
    )


def _remedy(
    filtered: GeneralizedPlant,
    controller: control.StateSpace,
    period: float,
    delay: float,
    method: str,
    prewarp_hz: float | None,
) -> str:
    found = longest_period(filtered, controller, delay, method=method, prewarp_hz=prewarp_hz)
    if found == 0 and delay == 0:
        return (
            "No period was found that keeps it stable: with a controller this fast, doubles "
            "cannot tell slow poles from the unit circle. Design a slower controller, with a price "
            "on u and noise on y."
        )
    if found == 0:
        return (
            "It is so however short the period: the delay (and the filter) alone make it unstable. "
            "Shorten the delay, or design with delay and actuators in the plant."
        )
    if found < period:
        return (
            f"The longest period that keeps it stable is {duration(found)}. Sample faster, or "
            "design a slower controller: with a price on u, noise on y and delay in the plant."
        )
    return "Other periods near it are stable; change it a little, or use method='zoh'."
