"""The catalogue of methods, one file per family. Nothing is built until it is asked for."""
