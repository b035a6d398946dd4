"""The verbs of the command, one file each; a file holds its options and what it prints."""
