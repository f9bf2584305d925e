"""Many cases that differ in a few keys of one deck, and one data set of what came of them."""
