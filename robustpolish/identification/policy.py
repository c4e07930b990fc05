"""Tolerances and limits of fits and decisions, each with its reason and a case that it is for.

Cases in quotation marks are those of docs/hidden_effects.md: examples of what a number decides.
"""

from __future__ import annotations

from dataclasses import dataclass

from robustpolish.identification.observer.kalman import FREE, Level

STRONG = 5.0
"""Nats of very strong evidence, 2 ln B = 10 (Kass and Raftery 1995, JASA 90, 773-795)."""
NEGLIGIBLE = 2e-3
"""Share of the motion below which an error does not count."""


def _levels(*shares: float) -> tuple[Level, ...]:
    return tuple(Level(share) for share in shares)


@dataclass(frozen=True)
class Policy:
    """Thresholds, levels and sizes of a diagnosis; what follows from another is a property.

    Attributes
    ----------
    visible_fall : float
        Share by which an error has to fall to be seen.
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
    few_steps : int
        Most steps of a stage of a fit to a long record, and of one with learned laws.
    mass_prior, gain_prior : float
        How well numbers are known beforehand, as shares: masses are weighed. Also how far screening
        lets them move.
    spring_share, damper_share : float
        How far screening lets stiffness and damping move: without a limit the smoothed motion of a
        mass that is not measured explains the missing force by an absurd spring ("coulomb to
        ground, x_m unmeasured").
    null_levels : tuple of Level
        Where models are compared as they are, without looking for effects.
    own_damping : float
        Damping ratio below which coloured noise resonates: that is a machine, no sensor.

    shape_levels : tuple of Level
        Where the free curve is tried.

    work : float
        Steps of simulation after which a search adds nothing more and follows nothing more; what it
        has is still compared with its like and fitted to the whole record. A processor makes 3 to 7
        million a second, and a diagnosis of under a minute needs 20 to 310 million: the limit is
        two to three minutes.

    growth : int
        By how much the windows of a candidate's fit grow: each stage costs as much as a fit.
    settled : float
        Relative fall of the cost below which the fit of a stage stops that only the next one begins
        with.
    shares : tuple of float
        Shares of an effect's first size with which its fit is begun, one after the other, until
        runs follow the data at all.
    nats : float
        Fall of the log-likelihood below which the last stage of a final fit stops: a standard error
        is half of one, so that a fit that stops sooner is off by more than it says.
    """

    visible_fall: float = 0.2
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
    few_steps: int = 7
    mass_prior: float = 0.05
    gain_prior: float = 0.05
    spring_share: float = 0.1
    damper_share: float = 0.5
    null_levels: tuple[Level, ...] = _levels(1.0, 0.1, 0.01)
    own_damping: float = 0.35
    shape_levels: tuple[Level, ...] = _levels(0.1, 0.01, 0.002)
    work: float = 6e8
    growth: int = 4
    settled: float = 0.03
    shares: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1)
    nats: float = 0.05

    @property
    def at_noise_floor(self) -> float:
        """Times the noise below which not even the noise alone would be a visible fall."""
        return 1 / (1 - self.visible_fall)

    @property
    def null_orders(self) -> tuple[int, ...]:
        """Noise colours with which models are compared as they are: the simplest two."""
        return self.noise_orders[:2]

    def follows(self, errors: int) -> float:
        """Return the relative fall of the cost, half the number of errors, that is `nats`."""
        return 2 * self.nats / errors


POLICY = Policy()
"""What `diagnose` and `refit` go by."""
