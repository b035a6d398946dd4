"""The catalogue of methods, one file per family. Nothing is built until it is asked for."""

from .entry import MethodEntry as MethodEntry
from .registry import catalogue as catalogue
from .registry import method as method
