"""The processor unit (PU): a 256-bit horizontal machine of four floating-point units, as software.

- `isa`: the one description of the microinstruction (fields, values, timing, tables); everything else follows from it;
- `meta`: the meta-assembler and the disassembler;
- `macro`: the macro assembler and the library of basic operation macros;
- `simulate`: the plain simulator, which is the definition, and the fast one;
- `lower`: the compiler from the IR to macro assembler source, and compiled programs as something to run;
- `schedule`: macros that overlap;
- `system`: a control processor with N processor units.
"""
