"""Estimates from recordings: the online algorithms on a file, and offline methods beside them."""
