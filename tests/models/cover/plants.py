"""Motors with a belt that resonates somewhere."""

import control


def rig(w, damping=0.1):
    """An integrator and a resonance at w rad/s."""
    return control.ss(control.tf([w**2], [1, 2 * damping * w, w**2, 0]))


RIGS = [rig(w) for w in (20.0, 22.0, 25.0, 28.0, 30.0)]
