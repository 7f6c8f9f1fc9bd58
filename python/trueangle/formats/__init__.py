"""File formats, for runs and logs: one file each; they know nothing of joints."""

from . import formats as formats  # the endings that no output of another kind may bear
