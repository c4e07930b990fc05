"""Laws that no catalogue holds, learned as curves."""
