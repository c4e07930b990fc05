"""Dry friction over one step: sliding on, turning round, or resting until the force gives way.

The force of ideal dry friction is no function of the velocity: at rest it is whatever holds, up to
its limit. A steep curve in its place creeps under every load. Over a step the velocity is nearly
linear in time, so that when the body stops, and what it does then, follow from its velocity at
both ends; the friction is then a force that jumps within the step, and what of it acts on the
state is its mean and its first moment (a time-stepping method with the events inside the step;
Acary, Brogliato (2008), Numerical Methods for Nonsmooth Dynamical Systems, chapters 8 and 10).
"""

from __future__ import annotations

from robustpolish.compiling import njit

LEAST = 1e-200
"""A velocity that is as good as none and says a direction."""


@njit(cache=True, nogil=True, error_model="numpy")
def friction_over_step(begin, free, mobility, now, forward, backward):  # type: ignore[no-untyped-def]
    """Return the friction over a step as a mean, its change over the step, and what it is at last.

    Parameters
    ----------
    begin : float
        Velocity at the beginning of the step; 0 of a body at rest.
    free : float
        Velocity at its end without the friction.
    mobility : float
        Velocity at the end that a unit of constant force gives; positive.
    now : float
        The friction while the body slides on as it does at the beginning.
    forward, backward : float
        The friction on a body that begins to slide in the one and the other direction;
        ``forward <= backward``.

    Returns
    -------
    mean, change, last : float
        ``mean + change (t - 1/2)`` over the step, t from 0 to 1, has the friction's impulse and
        moves the body as far. `last` is the force at the end.
    """
    end = free + mobility * now
    if begin * end > 0.0:
        return now, 0.0, now
    gained = free - begin
    stops = 0.0 if begin == 0.0 else begin / (begin - end)
    if gained + mobility * forward > 0.0:
        last = forward
    elif gained + mobility * backward < 0.0:
        last = backward
    else:
        last = -gained / mobility
    left = 1.0 - stops
    mean = stops * now + left * last
    moment = now * (stops - 0.5 * stops * stops) + 0.5 * last * left * left
    return mean, 6.0 * mean - 12.0 * moment, last
