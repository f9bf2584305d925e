"""Stress and displacement below the surface: where they are wanted, and what is computed there."""
