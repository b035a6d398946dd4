"""Compiled steps of a method on a scene: analysis, plan, source, machine code (see `stepping.compile_step`)."""
