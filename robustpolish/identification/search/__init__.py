"""Search for the missing effects: sets of effects, compared by one score in nats."""
