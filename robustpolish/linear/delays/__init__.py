"""Systems with exact delays."""
