"""Time stepping against C written by hand, and against other packages: work for a given precision."""
