"""Textual LLVM to running code: compiling, the object cache, aligned buffers. Knows neither the IR nor any machine."""
