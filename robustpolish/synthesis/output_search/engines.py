"""The engines of output feedback, and the order in which each method calls them.

To add one, write a subclass of :class:`~robustpolish.synthesis.output_search.engine.Engine` in a
file of its own and name it here.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.output_search.engine import Engine
from robustpolish.synthesis.output_search.lmi import LmiHinf
from robustpolish.synthesis.output_search.lmi_h2 import LmiH2
from robustpolish.synthesis.output_search.lqg import Lqg
from robustpolish.synthesis.output_search.riccati_ladder import RiccatiLadder
from robustpolish.synthesis.output_search.slycot import Slycot

METHODS = ("auto", "riccati", "lmi", "slycot")
ORDER: Mapping[tuple[Norm, str], tuple[type[Engine], ...]] = MappingProxyType(
    {
        ("hinf", "auto"): (RiccatiLadder, LmiHinf),
        ("hinf", "riccati"): (RiccatiLadder,),
        ("hinf", "lmi"): (LmiHinf,),
        ("hinf", "slycot"): (Slycot,),
        ("h2", "auto"): (Lqg,),
        ("h2", "riccati"): (Lqg,),
        ("h2", "lmi"): (LmiH2,),
        ("h2", "slycot"): (Slycot,),
    }
)
