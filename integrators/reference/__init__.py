"""Reference solutions to 30 digits, and steps of methods in any precision."""
