"""Tolerances and limits of fits and decisions, each with its reason and a case that it is for.

Cases in quotation marks are those of docs/hidden_effects.md: examples of what a number decides.
"""

from __future__ import annotations

from dataclasses import dataclass

from robustpolish.identification.observer.kalman import FREE, Level


def _levels(*shares: float) -> tuple[Level, ...]:
    return tuple(Level(share) for share in shares)


@dataclass(frozen=True)
class Policy:
    """Thresholds, levels and sizes of a diagnosis; what follows from another is a property.

    Attributes
    ----------
    visible_fall : float
        Share by which an error has to fall to be seen.
    following : tuple of Level
        Levels among which an observer looks for the one that shows the motion best.
    screening : tuple of Level
        From close guidance to a free run, then free runs with noise on the inputs ("quadratic
        damping, noise on the force"); the right effect lets the missing force vanish.
    guidance : tuple of Level
        Where all shapes are compared, beside the likeliest level: where the error is far above the
        noise, that one shows its fine structure; what is large shows in runs that are hardly led
        ("cubic and coulomb").
    silent : float
        Level up to which no missing force is seen: what is left is noise of some colour.
    noise_orders : tuple of int
        Of the autoregressive noise that competes with every effect ("nothing, coloured").
    finalists : int
        Effects at places that go on from each level; most of the catalogue's some 200 are hopeless.

    smoothing_shares : tuple of float
        Shares of the typical velocity over which a friction may turn over, among which a fit of it
        begins: from a tenth of the true one, or three times it, no slope leads there.
    lost : float
        Times by which an error jumps where a fit lost the data that the one before followed.

    vanished : float
        Share of its first size below which an effect has vanished in a stage of a fit, or a spring
        in the fit without effects.

    direct_steps, many_steps, few_steps : int
        Most steps of a direct fit, and of a stage for records up to and beyond `long_record`.
    better : float
        Share of the error that a direct fit has to reach where both are far from the noise
        ("wrong numbers, four masses, coloured").
    unchanged : float
        Log of a common factor, and of the error it may cost, that is not worth settling.

    mass_prior, gain_prior, spring_prior, damper_prior : float
        How well numbers are known beforehand, as shares: masses are weighed, springs are known
        roughly and dampers hardly ("cubic between, wrong numbers"). The first two also say how
        far screening lets them move.
    spring_share, damper_share : float
        How far screening lets stiffness and damping move: without a limit the smoothed motion of a
        mass that is not measured explains the missing force by an absurd spring ("coulomb to
        ground, x_m unmeasured").
    weighed : (float, float)
        Bounds of masses and gains, as multiples of what is known.
    nothing : float
        Share of its natural size up to which a spring or damper is as good as none and may well
        be missing.
    null_levels : tuple of Level
        Where models are compared as they are, without looking for effects.
    hold_orders, hold_delays, hold_odds : tuple of float, tuple of int, float
        What is tried to find out how inputs act between samples: orders of the hold beside the
        linear one, and delays in samples (a long delay looks half like a hold: "input delay");
        and the log odds from which a hold is believed.
    own_damping : float
        Damping ratio below which coloured noise resonates: that is a machine, no sensor.

    shape_above : float
        Times the noise up to which what is left of a motion is as good as over.
    shape_levels : tuple of Level
        Where the free curve is tried.

    work : float
        Steps of simulation after which a search adds nothing more and follows nothing more; what it
        has is still compared with its like and fitted to the whole record, which may take nearly as
        many. A processor makes 3 to 7 million a second: a diagnosis of under a minute needs 20 to
        310 million, and of a hundred drawn cases that come out right the longest takes 3000
        million. Where nothing comes near the noise, branches would go on for as long again.

    trial, screened, screened_imposed, least_moving : int
        Samples of a trial piece, and of what is screened; where all motion is imposed, screening
        is quick and the amplitudes of the whole record are welcome (the friction damper). The last:
        of what is screened at least, where a motion dies away early.
    swings, least_window, growth : float, int, int
        Swings of the fastest motion, and samples, that the first windows of a fit have at least,
        and by how much those of a candidate's fit grow: errors over a swing or two depend smoothly
        on every number, and each stage costs as much as a fit.
    settled : float
        Relative fall of the cost below which the fit of a stage stops that only the next one begins
        with.
    shares : tuple of float
        Shares of an effect's first size with which its fit is begun, one after the other, until
        runs follow the data at all.
    nats : float
        Fall of the log-likelihood below which the last stage of a final fit stops: a standard error
        is half of one, so that a fit that stops sooner is off by more than it says.
    windows, shortest_window : int
        Number and least length of windows, for models whose long runs judge nothing ("backlash
        between, in motion").
    long_record : int
        Samples from which a stage has to do with few steps.
    comfortable, longest, few : int
        Samples from which a record is thinned if its motion is slow enough for that, samples beyond
        which only a part of it is used, and samples that thinning leaves at least: a diagnosis of
        30,000 samples takes a minute, and one of 500,000 has to end in two.
    swing_samples, sharp_samples : float
        Samples per swing of the fastest motion that thinning leaves, and where accelerations or
        forces are measured, which jump with friction at every reversal: the filter against aliases
        rounds a jump over a few samples, the model does not, and of a jump's power the share of
        about a tenth of a sample is an error ("coulomb between, at 50 kHz"). Of a displacement it
        is two integrals less; there it is the harmonics that count, up to the 15th.
    kept : float
        Share that thinning leaves of the power of the forces, and of what the linear model leaves
        over. With broad forces friction acts at every change of a fast velocity, and a filtered
        force shows another friction: a part of the record says more there than a thinned whole.
    swings_kept : float
        Swings of the slowest mode that such a part lasts, or else more samples are left out.
    undetermined : float
        Standard error over the value from which a refit calls a number undetermined.
    """

    visible_fall: float = 0.2

    following: tuple[Level, ...] = _levels(10.0, 3.0, 1.0, 0.3, 0.1)
    screening: tuple[Level, ...] = (
        *_levels(1.0, 0.1, 0.01, 0.002),
        FREE,
        Level(0.0, 0.05),
    )
    guidance: tuple[Level, ...] = (Level(0.01), FREE)
    silent: float = 0.002
    noise_orders: tuple[int, ...] = (0, 1, 3)
    finalists: int = 24

    smoothing_shares: tuple[float, ...] = (0.1, 0.03, 0.01, 0.003)
    lost: float = 5.0
    vanished: float = 0.01

    direct_steps: int = 20
    many_steps: int = 15
    few_steps: int = 7
    better: float = 0.8
    unchanged: float = 0.01

    mass_prior: float = 0.05
    gain_prior: float = 0.05
    spring_prior: float = 0.3
    damper_prior: float = 1.0
    spring_share: float = 0.1
    damper_share: float = 0.5
    weighed: tuple[float, float] = (0.1, 10.0)
    nothing: float = 1e-6

    null_levels: tuple[Level, ...] = _levels(1.0, 0.1, 0.01)
    hold_orders: tuple[float, ...] = (0.0, 3.0)
    hold_delays: tuple[int, ...] = (1, 2, 4)
    hold_odds: float = 20.0
    own_damping: float = 0.35

    shape_above: float = 1.5
    shape_levels: tuple[Level, ...] = _levels(0.1, 0.01, 0.002)

    work: float = 4e9

    trial: int = 3500
    screened: int = 5000
    screened_imposed: int = 30000
    least_moving: int = 200
    least_window: int = 50
    swings: float = 1.5
    growth: int = 4
    settled: float = 0.03
    shares: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1)
    nats: float = 0.05
    windows: int = 25
    shortest_window: int = 60
    long_record: int = 4000
    comfortable: int = 30000
    longest: int = 30000
    few: int = 12000
    swing_samples: float = 40.0
    sharp_samples: float = 200.0
    kept: float = 0.99
    swings_kept: float = 20.0
    undetermined: float = 1 / 3

    @property
    def at_noise_floor(self) -> float:
        """Times the noise below which not even the noise alone would be a visible fall."""
        return 1 / (1 - self.visible_fall)

    @property
    def null_orders(self) -> tuple[int, ...]:
        """Noise colours with which models are compared as they are: the simplest two."""
        return self.noise_orders[:2]

    def steps(self, samples: int) -> int:
        """Return the most steps of a stage: short records can afford more."""
        return self.many_steps if samples < self.long_record else self.few_steps

    def follows(self, errors: int) -> float:
        """Return the relative fall of the cost, half the number of errors, that is `nats`."""
        return 2 * self.nats / errors

    def window(self, samples: int) -> int:
        """Return the samples of a window, for models whose long runs judge nothing."""
        return max(self.shortest_window, samples // self.windows)


POLICY = Policy()
"""What `diagnose` and `refit` go by."""
