"""Systems with delays: their Pade models, exact responses, roots and stability."""
