"""The thesis's listing of the brush, equation by equation, with its defects."""
