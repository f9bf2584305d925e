"""A contact problem in SI units, checked: bodies, gap, window, load steps."""
