"""Which orders of the angle error are real: selection with evidence, aliases, the paper."""
