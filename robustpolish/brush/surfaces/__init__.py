"""Surfaces that can be polished: the thesis's trough, and moulds of any shape."""
