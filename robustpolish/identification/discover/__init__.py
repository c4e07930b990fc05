"""What a model lacks: screening, refits, judgement, verdict."""
