"""The air bearing as masses joined by springs and dampers."""

from __future__ import annotations

from robustpolish.models.machines.air_bearing_parameters import AirBearingParameters
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.parts import Damper, Dof, Input, Output, Spring


def air_bearing_data(parameters: AirBearingParameters | None, dissipation: float) -> MechanicalData:
    """Return equations (8.46) as a mechanical model, in the signs of (8.47)."""
    p = AirBearingParameters() if parameters is None else parameters
    c = p.damping(dissipation)
    dofs, springs, dampers = [], [], []
    for axis in ("x", "y", "z"):
        vertical = axis == "z"
        bearing = f"{axis}_m"
        dofs += [Dof(bearing, p.m_z if vertical else p.m_x), Dof(axis, p.m_t)]
        springs += [
            Spring((bearing, "ground"), p.k_A if vertical else p.k_t),
            Spring((bearing, axis), p.k_z if vertical else p.k_x),
        ]
        dampers += [
            Damper((axis if vertical else bearing, "ground"), c.c_Z if vertical else c.c_A),
            Damper((bearing, axis), c.c_R if vertical else c.c_D),
        ]
    loads = [("F_x", "x", -1.0), ("F_y", "y", -1.0), ("F_z", "z", 1.0), ("F_p", "z_m", -1.0)]
    return MechanicalData(
        dofs=tuple(dofs),
        springs=tuple(springs),
        dampers=tuple(dampers),
        inputs=tuple(Input(name, (on, "ground"), gain=gain) for name, on, gain in loads),
        outputs=tuple(Output(dof.name, (dof.name, "ground")) for dof in dofs),
        name="air bearing",
    )
