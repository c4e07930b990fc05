"""How a controller is stored and computed: forms, rounding, limits."""
