"""What every room uses: angles and units, signals and roles, files, distributions, deadlines."""
