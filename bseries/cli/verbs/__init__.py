"""The verbs of the command, one file each; with its options and its output."""
