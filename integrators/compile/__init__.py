"""From formulas to machine code: operation graph, printed source, LLVM code, and the cache on disk."""
