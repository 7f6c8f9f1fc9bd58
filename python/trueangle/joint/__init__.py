"""The machine: shafts, gear lines, the pattern, and signals at every reading."""
