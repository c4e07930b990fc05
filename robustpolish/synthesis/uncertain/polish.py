"""Controllers that are proven for every machine within bounds: D-K iteration, then a polish."""
