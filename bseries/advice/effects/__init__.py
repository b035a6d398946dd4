"""Effects of a scene: their influence on a run, and their cost."""
