"""From where on something is said; a false alarm costs more than one that is missing."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """The thresholds of the warnings.

    Attributes
    ----------
    held : int
        Samples of exactly one value that make a dropout: fewer come about by chance in a coarse
        converter.
    jump : float
        Times the largest step nearby that a signal jumps when a dropout ends. One that was held
        for five steps at full speed jumps by six of them; one that stopped by itself, as a mass in
        friction does, by one.
    repeats : float
        Share of a channel in stretches of one value beyond which it is held, coarse or stuck by
        nature.
    white : float
        Correlation of neighbouring samples below which a displacement is no motion, but noise: a
        mass moves on from one sample to the next.
    least : int
        Samples below which nothing is said of noise, signs and units.
    averages : int
        Stretches that spectra are averaged over: enough for a coherence, few enough for lines
        that are narrow against the modes.
    coherence : float
        From which a line is taken to follow from the inputs; of lines of noise one in 500 does.
    excited : float
        Share of the largest power that a line of the model needs: what is less is leakage.
    lines : int
        Such lines that have to speak for a sign or a unit, and `band`, times the lowest, how far
        they have to reach. Between the resonance of a machine and that of its model, where the
        stiffness is wrong, one swings against the other with nothing wrong with the sign.
    band : float
        See `lines`.
    reversed : float
        Share of them that have to be turned, within 45 degrees, and `steady`, the factor that half
        of the gains have to lie within: between two resonances they run from nothing to infinity.
    steady : float
        See `reversed`.
    near : float
        Factor by which the ratio of amplitudes may miss a power of a thousand, as stiffnesses are
        guessed, and `close` for 57.3 and 9.81, which a guess might be off by.
    close : float
        See `near`.
    scatter : float
        Factor that half of the lines have to lie within, for a ratio to be one of units.
    crossed : float
        Distance of outputs that have changed places from the model, in the logarithm, below which
        they fit, and `straight`, times that, by which they have to be further away as they are.
    straight : float
        See `crossed`.
    mean : float
        Times the spread of an output that its mean may lie from the model's.
    moved : float
        Factor by which a fit may change a mass, a stiffness or a gain; 1.5 decades.
    damped : float
        The same for dampings, which are guessed to a decade at best.
    guessed : float
        Factor by which a change may miss the one that a confusion of units would make.
    """

    held: int = 5
    jump: float = 3.0
    repeats: float = 0.2
    white: float = 0.2
    least: int = 200
    averages: int = 7
    coherence: float = 0.8
    excited: float = 1e-5
    lines: int = 8
    band: float = 3.0
    reversed: float = 0.8
    steady: float = 1.7
    near: float = 2.5
    close: float = 1.08
    scatter: float = 3.0
    crossed: float = 0.3
    straight: float = 3.0
    mean: float = 3.0
    moved: float = 30.0
    damped: float = 100.0
    guessed: float = 3.0


LIMITS = Limits()
"""What the warnings go by."""
