"""Stress, displacement and fatigue parameters below the surface."""
