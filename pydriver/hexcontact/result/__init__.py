"""Results of a run: load steps, the result file and its journal, tables and exports made from them."""
