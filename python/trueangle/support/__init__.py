"""What every room uses: angles and units, files, distributions, deadlines, suggestions."""
