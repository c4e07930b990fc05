"""Controllers with fewer states: candidates, which the certified loop then judges."""
