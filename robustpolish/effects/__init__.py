"""The catalogue of physical effects: what a kind is, and one file per kind."""

from robustpolish.effects.along import force_along as force_along
from robustpolish.effects.along import force_with as force_with
from robustpolish.effects.along import shapes_along as shapes_along
from robustpolish.effects.compiled import call_law as call_law
from robustpolish.effects.compiled import compiled_law as compiled_law
from robustpolish.effects.effect import Effect as Effect
from robustpolish.effects.effect import kinds as kinds
from robustpolish.effects.effect import lookup as lookup
from robustpolish.effects.effect import register as register
from robustpolish.effects.effect import unregister as unregister
from robustpolish.effects.equivalent_damping import energy_per_cycle as energy_per_cycle
from robustpolish.effects.equivalent_damping import equivalent_damping as equivalent_damping
from robustpolish.effects.equivalent_damping import loss_damping as loss_damping
from robustpolish.effects.equivalent_damping import share_damping as share_damping
from robustpolish.effects.formula import Formula as Formula
from robustpolish.effects.kind import CONSTANT as CONSTANT
from robustpolish.effects.kind import GROUND as GROUND
from robustpolish.effects.kind import EffectKind as EffectKind
from robustpolish.effects.kind import Parameter as Parameter
from robustpolish.effects.learned_law import LearnedLaw as LearnedLaw
from robustpolish.effects.own import OWN_KEYS as OWN_KEYS
from robustpolish.effects.own import own_kind as own_kind
from robustpolish.effects.own import own_table as own_table
from robustpolish.effects.shapes import Motion as Motion
from robustpolish.effects.shapes import Scan as Scan
from robustpolish.effects.shapes import Shape as Shape
