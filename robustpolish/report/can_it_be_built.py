"""What a report tells of a controller that is to be built: margins, limits, what could go wrong."""

from __future__ import annotations

import math

import numpy as np

from robustpolish.closed_loop import BuildableBrushDesign
from robustpolish.closed_loop.buildable_axis import POLICY
from robustpolish.closed_loop.limits_of_hardware import BUILDABLE
from robustpolish.display import Table
from robustpolish.report.document import Section
from robustpolish.report.pictures import panels, picture
from robustpolish.si_prefix import prefix_power, prefixed


def can_it_be_built(job: BuildableBrushDesign) -> Section:
    """Tell margins, rates and effort, what the loop is like, and what each limit costs."""
    h, ideal = job.hardware, job.ideal_loop
    text = (
        "Force control at the brush: electromagnets in the nose of the air bearing pull at the "
        "brush's hub, the bearing takes the reaction, and sensors beside them measure the gap. "
        "Of the thesis's six forces these two remain.",
        "At the samples, where hold and computation are exact: " + job.loop.explain(),
        f"The thesis's ideal bears a delay of {_time(ideal.delay_margin)}, this one "
        f"{_time(job.loop.delay_margin)} besides the {_time(h.computation_delay)} of computation "
        "and the hold that it has.",
        f"{job.sampled.message} That is the norm of x, y and z together; of y alone it is "
        f"{job.axis.sampled.certificate.achieved:.4g} m/N.",
        _dearest(job),
    )
    return Section(
        "Can it be built?",
        text,
        (
            picture(
                "The loops at the controls, one at a time, and the disk that they keep clear of.",
                lambda ax: job.loop.plot(ax, kind="nyquist"),
            ),
        ),
        (
            job.tables()[0],
            what_reality_costs(job),
        ),
    )


def what_reality_costs(job: BuildableBrushDesign) -> Table:
    """Return the table of limits, each relaxed while the others stay."""
    built = next(row for row in job.limits if row.what == BUILDABLE)
    power = prefix_power(built.deviation)
    rows = tuple(
        (row.what, row.norm, row.norm / built.norm, row.deviation / 10.0**power, row.effort)
        for row in job.limits
    )
    deviation = f"largest deviation [{prefixed('m', power)}]"
    head = ("y", "norm [m/N]", "of that as built", deviation, "largest force [N]")
    caption = "What reality costs: one limit relaxed at a time, designed anew"
    return Table(caption, head, rows)


def what_could_go_wrong(job: BuildableBrushDesign) -> Section:
    """List what was assumed, with the numbers at which it breaks."""
    h, noise = job.hardware, job.noise_effort
    upper = job.axis.problem.frequencies()[0]
    clipped = max(float(job.run[name].attrs["at_limit"]) for name in job.plant.control_names)
    most = max(float(np.abs(job.run[name]).max()) for name in job.plant.control_names)
    crossover = max(c.frequency_hz for m in job.loop.margins for c in m.gain_crossovers)
    points = (
        f"More delay: {_time(job.loop.delay_margin)} more, from drives, filters or cables, and the "
        "loop is unstable.",
        f"Slower sampling: beyond a period of {_time(job.largest_period)} "
        f"({1e-3 / job.largest_period:.3g} kHz), the computation growing with it, it is unstable; "
        f"it runs at {h.sample_rate_hz / 1e3:g} kHz.",
        "Slower actuators: " + _slower(job),
        f"Flexible modes that are not in the model: nothing above {upper:.0f} Hz is modelled. "
        f"The loop's gain is last 1 at {crossover:.0f} Hz; a mode above is harmless while it "
        f"stays below {_spill(job):.3g} µm/N at resonance "
        f"between {crossover / 1e3:.2g} and {h.sample_rate_hz / 2e3:g} kHz. Beyond "
        f"{h.sample_rate_hz / 2e3:g} kHz it appears at another frequency. Measure the gap's "
        "response to the actuator before closing the loop.",
        f"The bearing's own mode at {upper:.0f} Hz: the loop was certified with its stiffness "
        f"{100 * POLICY.stiffness_error:g} % lower and higher.",
        f"Noise: {h.sensor_noise * 1e9:g} nm RMS in every reading moves the actuators by "
        f"{max(noise.values()):.2g} N RMS.",
        f"A hub that is not round, or whose material is uneven, looks like a motion at the "
        f"spindle's {_spin(job):.3g} Hz: the brush then follows {_follows(job):.2g} µm for each "
        "µm, unless it is measured and subtracted.",
        f"Saturation: {most:.3g} N of {h.actuator_limit:g} N are used, and "
        f"{100 * clipped:.2g} % of the samples were cut off. The conditioned form of the "
        "controller keeps it from winding up; no norm is proven at the limit.",
        "Drift of the sensors is followed one to one: the integral action believes the gap.",
        "Gyroscopic moments of the spinning brush, which couple x and y, are not in the model.",
    )
    survived = tuple((what, c.valid, c.achieved, c.bound) for what, c in job.survived.items())
    return Section(
        "What could go wrong",
        tables=(
            Table(
                "The same code on other machines, x and y, certified between samples",
                ("machine", "proven", "norm [m/N]", "proven below [m/N]"),
                survived,
            ),
        ),
        points=points,
    )


def why_z_stays(job: BuildableBrushDesign) -> Section:
    """Explain z, where a percentage of the largest deviation tells little."""
    table = job.comparison.table
    rows = [str(row) for row in table["row"].values]
    largest = {row: float(table["deviation"].sel(row=row, signal="z")) for row in rows}
    static, without, ideal = abs(job.static_deflection), largest[rows[0]], largest[rows[-1]]
    half = 0.5e6 / _mode_of_z(job)
    gain = 100 * (1 - ideal / without) if without else math.nan
    text = (
        f"The mean of the brush's forces bends z by {static * 1e9:.0f} nm, without control and "
        "with the ideal alike: a state feedback without integral action and with a priced "
        "force does not stiffen a rod that is stiff already. What the ideal takes "
        f"away is overshoot: {without * 1e9:.0f} nm become {ideal * 1e9:.0f} nm, which "
        f"the table calls an improvement of {gain:.2f} %.",
        f"The static part needs integral action or a stiffer rod; {static * 1e9:.0f} nm are "
        "what some kelvin do to an eddy-current sensor, and the robot's own position can correct "
        "what is constant.",
        f"The overshoot is over within half a period of the mode, {half:.0f} µs, where the lags of "
        f"sensor, computer and actuator alone make {1e6 * job.hardware.lag:.0f} µs. So z gets no "
        "actuator.",
    )
    shown = {row: job.comparison.responses[row] for row in (rows[0], rows[-1])}
    return Section("Why z is left alone", text, (panels("z without control.", shown, ("z",)),))


def effort_of(job: BuildableBrushDesign) -> Section:
    """Show the forces of the actuators."""
    noise = job.noise_effort
    rows = tuple(
        (
            name,
            float(np.abs(job.run[name]).max()),
            float(np.sqrt((job.run[name] ** 2).mean())),
            noise[name],
            100 * float(job.run[name].attrs["at_limit"]),
        )
        for name in job.plant.control_names
    )
    head = ("control", "largest [N]", "RMS [N]", "by noise, RMS [N]", "samples at the limit [%]")
    controls = job.plant.control_names
    responses = {"with control": job.comparison.responses["with control"]}
    return Section(
        "Effort",
        (job.design.message,),
        (panels("Forces of the actuators.", responses, controls),),
        (Table("Control effort", head, rows),),
    )


def hardware_table(job: BuildableBrushDesign) -> Table:
    """Return the parts with their sources."""
    return Table("Hardware", ("part", "value", "unit", "source"), tuple(job.hardware.table()))


def sampled_certificate(job: BuildableBrushDesign) -> Table:
    """Return what is proven about the sampled loop."""
    c = job.sampled.certificate
    rows = (
        ("proven stable, between samples too", c.valid),
        ("induced L2 norm, proven to be at least", c.lower),
        ("induced L2 norm, proven to be at most", c.bound),
        ("largest pole from sample to sample", c.spectral_radius),
        ("period [s]", c.period),
        ("computation delay [s]", c.delay),
        ("states of the controller", job.sampled.controller.nstates),
    )
    return Table("The sampled loop of x, y and z", ("quantity", "value"), rows, digits=6)


def buildable_summary(job: BuildableBrushDesign) -> dict[str, object]:
    """Return the figures of what is to be built for other programs."""
    c = job.sampled.certificate
    return {
        "hardware": {name: value for name, value, _, _ in job.hardware.table()},
        "good": job.good,
        "sampled": {
            "valid": c.valid,
            "stable": c.stable,
            "achieved": c.achieved,
            "bound": c.bound,
            "period": c.period,
            "delay": c.delay,
            "spectral_radius": c.spectral_radius,
            "largest_period": job.largest_period,
        },
        "loop": job.loop.to_dict(),
        "words": job.loop.explain(),
        "ideal_delay_margin_s": job.ideal_loop.delay_margin,
        "survived": {
            what: {"valid": found.valid, "achieved": found.achieved}
            for what, found in job.survived.items()
        },
        "slowest_actuator_hz": job.slowest_actuator_hz,
        "largest_force": {n: float(np.abs(job.run[n]).max()) for n in job.plant.control_names},
        "noise_force_rms": job.noise_effort,
        "static_deflection_z": job.static_deflection,
        "limits": [dict(vars(row)) for row in job.limits],
    }


def _dearest(job: BuildableBrushDesign) -> str:
    """Say which limit costs most."""
    built = next(row for row in job.limits if row.what == BUILDABLE)
    place = job.limits.index(built)
    relaxed = [row for row in job.limits[place + 1 : -1] if math.isfinite(row.norm)]
    if not relaxed:
        return "With none of the limits relaxed a better controller was found."
    best = min(relaxed, key=lambda row: row.norm)
    ideal = job.limits[-1]
    return (
        f"Reality costs a factor of {built.norm / ideal.norm:.3g} in the norm of y against the "
        f"ideal. Of the limits the one that costs most is relaxed by {best.what}: the norm "
        f"would be {best.norm:.3g} instead of {built.norm:.3g} m/N, the largest deviation "
        f"{best.deviation * 1e6:.3g} instead of {built.deviation * 1e6:.3g} µm. Bandwidths were "
        f"tried in steps of {100 * (1 - POLICY.ratio):.0f} %, so that a difference of 15 % in the "
        "norm says little."
    )


def _slower(job: BuildableBrushDesign) -> str:
    slowest, nominal = job.slowest_actuator_hz, job.hardware.actuator_bandwidth_hz
    if not slowest:
        return "no bandwidth was found that makes the loop unstable."
    return (
        f"below {slowest:.0f} Hz the loop is unstable; they have {nominal:g} Hz, and with "
        f"{100 * POLICY.actuator_loss:g} % less it is certified in the table below."
    )


def _spill(job: BuildableBrushDesign) -> float:
    """Return the response in µm/N that a mode beyond the crossover may have at most."""
    controller = job.sampled.controller
    half = job.hardware.sample_rate_hz / 2
    crossover = max(c.frequency_hz for m in job.loop.margins for c in m.gain_crossovers)
    turns = np.exp(2j * np.pi * np.linspace(crossover, half, 200) * job.hardware.period)
    gain = max(float(np.linalg.norm(np.atleast_2d(controller(z)), 2)) for z in turns)
    return 1e6 / gain


def _spin(job: BuildableBrushDesign) -> float:
    return float(job.disturbance.attrs.get("spin", 0.0)) / (2 * math.pi)


def _follows(job: BuildableBrushDesign) -> float:
    """Return by how much the brush follows an error of the measurement at the spindle's speed."""
    turn = np.exp(2j * np.pi * _spin(job) * job.hardware.period)
    return float(abs(np.atleast_2d(job.loop.T(turn))[0, 0]))


def _mode_of_z(job: BuildableBrushDesign) -> float:
    return job.parameters.natural_frequencies()["z"][1] / (2 * math.pi)


def _time(seconds: float) -> str:
    return f"{1e6 * seconds:.3g} µs"
