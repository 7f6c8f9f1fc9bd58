"""The exam outside the vocabulary: what has no name, noise alone, beliefs, several, eight sigma.

Forms, seeds and noise are this exam's own; joints, designs and the logger are those of
`tests.python.hidden`.
"""
