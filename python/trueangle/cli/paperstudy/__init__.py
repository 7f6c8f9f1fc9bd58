"""The paper's study from its own equations, and what its 36 positions hide."""
