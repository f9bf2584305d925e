"""The input format: tables of a deck, kinds of values, reading and writing, mistakes in words."""
