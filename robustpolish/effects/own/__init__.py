"""Effects of your own: a formula, read safely, as a kind of effect like any other."""

from robustpolish.effects.own.define import effect as effect
from robustpolish.effects.own.define import own_kind as own_kind
from robustpolish.effects.own.define import own_table as own_table
from robustpolish.effects.own.written import OWN_KEYS as OWN_KEYS
