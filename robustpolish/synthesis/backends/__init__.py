"""One module per outside solver library; nothing else in the package imports them."""
