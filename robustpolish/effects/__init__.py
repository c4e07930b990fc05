"""The catalogue of physical effects: one file per kind."""

from robustpolish.effects.base import CONSTANT as CONSTANT
from robustpolish.effects.base import GROUND as GROUND
from robustpolish.effects.base import Effect as Effect
from robustpolish.effects.base import EffectKind as EffectKind
from robustpolish.effects.base import Parameter as Parameter
from robustpolish.effects.base import compiled_law as compiled_law
from robustpolish.effects.base import force_along as force_along
from robustpolish.effects.registry import kinds as kinds
from robustpolish.effects.registry import lookup as lookup
from robustpolish.effects.registry import register as register
from robustpolish.effects.shapes import Motion as Motion
from robustpolish.effects.shapes import Shape as Shape
