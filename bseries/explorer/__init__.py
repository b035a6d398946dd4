"""The explorer: a method and its flows on a scene, as a page of a local server or as one file."""
