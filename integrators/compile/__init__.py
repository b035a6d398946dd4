"""Compilation of formulas, in the order in which `scene_source.compiled_scene` calls the stages.

::

    formulas in SymPy
        │   operation_graph.Reader          exact numbers and operations, each of them once
        │   operation_graph.expand_powers   products, divisions and roots; Horner's rule; common factors
        ▼
    operation graph
        │   printer.source_lines            assignments in Python
        │   scene_source.SiteSum            loops over particles, or SIMD lanes
        │   printer.ModuleText              functions and constant arrays
        ▼
    source of a module
        │   modules.load_module             module in memory, named by all that its machine code depends on
        │   lowering                        LLVM code of steps and other large functions; numba compiles the rest
        │   bseries_base.machine_code         cache on disk
        ▼
    machine code
"""
