"""One-step methods as exact data."""
