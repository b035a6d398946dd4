"""From a scene and a method to compiled steps: structure, plan, source, and the kernels that the source calls."""
