"""Common ground: errors, argument checks, immutable values, files and optional packages."""
