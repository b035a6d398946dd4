"""Common ground of the three packages: machine code on disk, limits of memory, optional packages."""
