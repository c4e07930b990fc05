"""Plants of random numbers."""

import robustpolish as rp


def random_plant(rng, nx=4, nw=2, nu=3, nz=2, ny=2, dt=0, D22=True):
    """Return a plant of these sizes; all nine matrices are full."""

    def shape(*n):
        return rng.standard_normal(n)

    return rp.GeneralizedPlant.from_matrices(
        shape(nx, nx),
        shape(nx, nw),
        shape(nx, nu),
        shape(nz, nx),
        shape(ny, nx),
        shape(nz, nw),
        shape(nz, nu),
        shape(ny, nw),
        shape(ny, nu) * D22,
        dt=dt,
    )
