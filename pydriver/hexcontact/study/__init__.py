"""Studies: cases that differ in some keys of one deck, and their results in one dataset."""
