"""What is known of the machine: shafts, gear lines, the pattern, what happened at every reading."""
