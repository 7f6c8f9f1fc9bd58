"""What a rig read: runs and their readings, files and tables of them, checks, joins, aliases."""
