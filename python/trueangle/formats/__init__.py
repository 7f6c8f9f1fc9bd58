"""File formats, for runs and logs alike: one file each; they know nothing of joints."""
